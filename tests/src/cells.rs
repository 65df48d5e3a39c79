//! Tiles made of a few values over and over, and the core run on them.

use linpred_core::{
    Cells, Denoised, FeatureSet, LayerTile, OtherFeatures, OtherFrame, Params, PixelState,
    Predictions, Scratch, TILE_AREA, resolve,
};

/// Features of a pixel.
pub const FEATURES: usize = 9;

/// A tile with the features of a row of the pipeline.
pub type Tile = linpred_core::Tile<FEATURES>;

/// What became of a tile.
#[derive(Clone, Debug)]
pub struct Cell {
    /// How many models it took.
    pub models: u32,
    /// What they predict.
    pub predictions: Box<Predictions>,
    /// The pixels, as if no other cell reached them.
    pub pixels: Vec<Denoised>,
}

/// Denoises the cell of a tile, and resolves the whole tile.
pub fn denoise(tile: &Tile, params: &Params) -> Cell {
    let (mut scratch, mut predictions) = (
        Box::new(Scratch::<FEATURES, 1>::new()),
        Box::new(Predictions::NONE),
    );
    let models = linpred_core::denoise_cell(tile, params, &mut [], &mut scratch, &mut predictions);
    let pixels = tile.pixels.iter().zip(&predictions.sums);
    Cell {
        models,
        pixels: pixels
            .map(|(pixel, sum)| resolve(pixel, sum, params.formulas))
            .collect(),
        predictions,
    }
}

/// A cell on its way: its tile and layers, and what comes of them.
#[derive(Clone, Debug)]
pub struct Job {
    /// What is denoised.
    pub tile: Box<Tile>,
    /// Other features, for models that vary in what they see.
    pub otherwise: Option<Box<OtherFeatures<FEATURES>>>,
    /// What follows it.
    pub layers: Vec<LayerTile>,
    /// The same place in the frames around, each with its layers.
    pub frames: Vec<(Tile, Vec<LayerTile>)>,
    /// What the models predict.
    pub predictions: Box<Predictions>,
    /// How many models it took; `None` until it is done.
    pub models: Option<u32>,
}

impl Job {
    /// A cell that nothing is known of yet; its predictions are what no cell may leave there.
    pub fn new(tile: Box<Tile>, layers: Vec<LayerTile>) -> Self {
        let mut predictions = Box::new(Predictions::NONE);
        for sum in &mut predictions.sums {
            sum.confidence = f32::NAN;
        }
        Self {
            tile,
            otherwise: None,
            layers,
            frames: Vec::new(),
            predictions,
            models: None,
        }
    }

    /// The bits of all that came of it: predictions, layers' sums and models.
    pub fn bits(&self) -> (Option<u32>, Vec<u32>) {
        let sums = self.predictions.sums.iter().flat_map(|sum| {
            let [red, green, blue] = sum.colour;
            [
                red,
                green,
                blue,
                sum.confidence,
                sum.error,
                sum.radius,
                sum.rank,
            ]
        });
        let layers = self.layers.iter().flat_map(|layer| layer.sums).flatten();
        (self.models, sums.chain(layers).map(f32::to_bits).collect())
    }
}

/// Cells that wait for a lane, and those that have one.
struct Queue<'a> {
    jobs: &'a mut [Job],
    order: &'a [usize],
    taken: usize,
    /// Which job each lane has.
    lanes: Vec<usize>,
}

impl Cells<FEATURES> for Queue<'_> {
    fn next(&mut self, lane: usize) -> bool {
        let Some(&job) = self.order.get(self.taken) else {
            return false;
        };
        self.taken += 1;
        self.lanes[lane] = job;
        self.jobs[job].layers.iter_mut().for_each(LayerTile::clear);
        true
    }

    fn tile(&self, lane: usize) -> &Tile {
        &self.jobs[self.lanes[lane]].tile
    }

    fn otherwise(&self, lane: usize) -> Option<&OtherFeatures<FEATURES>> {
        self.jobs[self.lanes[lane]].otherwise.as_deref()
    }

    fn frame(&self, lane: usize, k: usize) -> Option<OtherFrame<'_, FEATURES>> {
        let (tile, layers) = self.jobs[self.lanes[lane]].frames.get(k)?;
        Some(OtherFrame { tile, layers })
    }

    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]) {
        let job = &mut self.jobs[self.lanes[lane]];
        (&mut job.predictions, &mut job.layers)
    }

    fn done(&mut self, lane: usize, models: u32) {
        let before = self.jobs[self.lanes[lane]].models.replace(models);
        assert_eq!(before, None, "a cell is done once");
    }
}

/// Denoises the cells of `jobs` in this order, `L` side by side.
pub fn denoise_side_by_side<const L: usize>(jobs: &mut [Job], order: &[usize], params: &Params) {
    let mut queue = Queue {
        jobs,
        order,
        taken: 0,
        lanes: vec![0; L],
    };
    let mut scratch = Box::new(Scratch::<FEATURES, L>::new());
    linpred_core::denoise_cells(&mut queue, params, &mut scratch);
}

/// The features of a tile and their variances as every other set, each value changed by `change`.
pub fn otherwise(tile: &Tile, change: impl Fn(f32) -> f32) -> Box<OtherFeatures<FEATURES>> {
    let mut set = FeatureSet::EMPTY;
    for (value, pixel) in set.value.iter_mut().zip(&tile.pixels) {
        // The position is no feature that a renderer writes.
        for (k, (own, value)) in value.iter_mut().zip(pixel.features).enumerate() {
            *own = if k < 2 { value } else { change(value) };
        }
    }
    set.variance = tile.feature_variance;
    Box::new([set.clone(), set])
}

/// A tile whose values are `values` again and again, within what a tile may hold: what is not finite is taken
/// for 0, magnitudes above 1e15 for that, weights and variances are not negative and at most 1e30, and the states
/// follow `states`.
///
/// Panics if either is empty.
pub fn tile(values: &[f32], states: &[u8]) -> Box<Tile> {
    let mut tile = Box::new(Tile::EMPTY);
    let mut values = values.iter().cycle().map(|v| {
        let v = if v.is_finite() { *v } else { 0.0 };
        v.clamp(-1e15, 1e15)
    });
    let mut next = move || values.next().expect("not empty");
    for i in 0..TILE_AREA {
        let pixel = &mut tile.pixels[i];
        let square = |v: f32| (v * v).min(1e30);
        for k in 2..FEATURES {
            pixel.features[k] = next();
            tile.feature_variance[i][k] = square(next());
        }
        pixel.features[0] = (i % linpred_core::TILE) as f32;
        pixel.features[1] = (i / linpred_core::TILE) as f32;
        pixel.colour = [next(), next(), next()];
        pixel.weight = square(next());
        pixel.variance = square(next());
        pixel.tolerance = square(next()).max(pixel.variance);
        pixel.state = match states[i % states.len()] % 8 {
            0 => PixelState::Outside,
            1 => PixelState::Bad,
            2 => PixelState::Clean,
            _ => PixelState::Noisy,
        };
        match pixel.state {
            PixelState::Outside => *pixel = linpred_core::Pixel::OUTSIDE,
            PixelState::Bad => (pixel.colour, pixel.weight) = ([0.0; 3], 0.0),
            PixelState::Clean => pixel.variance = 0.0,
            PixelState::Noisy => {}
        }
    }
    tile
}
