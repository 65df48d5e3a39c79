//! Wider registers change no bit.

use std::io::Write as _;

use linpred_core::{
    BLOCK_COLUMNS, BLOCK_HEIGHT, Cells, ColourBlock, ComparedRow, FeatureGroup, FilteredGroup,
    FinishedPlane, LayerTile, LitRow, NoiseBlock, NoisyBlock, Params, PixelState, Precisions,
    Predictions, SMOOTHINGS, Scratch, SpeckRow, Surroundings, TILE, TILE_FEATURES, Tile,
    WIDE_TILE_FEATURES, WeightBlock, finish_columns,
};

use linpred_dispatch::{InstructionSet, LANES};

/// What this processor has; says which it lacks, as the harness would hide what is printed.
fn instruction_sets() -> Vec<InstructionSet> {
    let mut all = vec![InstructionSet::BASELINE];
    let wider = [
        ("AVX2", InstructionSet::avx2()),
        ("AVX-512", InstructionSet::avx512()),
    ];
    for (name, instruction_set) in wider {
        if instruction_set.is_none() && cfg!(target_arch = "x86_64") {
            let line = format!("NOT TESTED: this processor lacks {name}\n");
            std::io::stderr().write_all(line.as_bytes()).unwrap();
        }
        all.extend(instruction_set);
    }
    all
}

/// Numbers in 0..1 that look random.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f32 {
        // xorshift32 (Marsaglia 2003)
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    fn fill<'a>(&mut self, planes: impl IntoIterator<Item = &'a mut f32>) {
        planes.into_iter().for_each(|value| *value = self.next());
    }
}

/// Cells of all sorts: features from an edge to noise alone, and missing pixels in every third.
struct Row<const D: usize> {
    tiles: Vec<Tile<D>>,
    predictions: Vec<Predictions>,
    layers: Vec<[LayerTile; 1]>,
    /// Which tile each lane has.
    lanes: [usize; LANES],
    next: usize,
    models: Vec<u32>,
}

impl<const D: usize> Row<D> {
    fn new(noise: &mut Noise) -> Self {
        let count = LANES + 3;
        let mut row = Self {
            tiles: (0..count).map(|kind| tile(kind, noise)).collect(),
            predictions: vec![Predictions::NONE; count],
            layers: vec![[LayerTile::BLACK]; count],
            lanes: [0; LANES],
            next: 0,
            models: vec![0; count],
        };
        for [layer] in &mut row.layers {
            noise.fill(layer.colour.as_flattened_mut());
        }
        row
    }
}

impl<const D: usize> Cells<D> for Row<D> {
    fn next(&mut self, lane: usize) -> bool {
        self.lanes[lane] = self.next;
        self.next += 1;
        self.lanes[lane] < self.tiles.len()
    }

    fn tile(&self, lane: usize) -> &Tile<D> {
        self.tiles.get(self.lanes[lane]).unwrap_or(&self.tiles[0])
    }

    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]) {
        let cell = self.lanes[lane].min(self.tiles.len() - 1);
        (&mut self.predictions[cell], &mut self.layers[cell])
    }

    fn done(&mut self, lane: usize, models: u32) {
        self.models[self.lanes[lane]] = models;
    }
}

fn tile<const D: usize>(kind: usize, noise: &mut Noise) -> Tile<D> {
    let mut tile = Tile::EMPTY;
    for (i, pixel) in tile.pixels.iter_mut().enumerate() {
        let (x, y) = ((i % TILE) as f32, (i / TILE) as f32);
        let edge = if 2.0 * x + y > 50.0 { 0.8 } else { 0.1 };
        let roughness = 0.1 * (kind % 4) as f32;
        pixel.features = std::array::from_fn(|_| edge + roughness * noise.next());
        (pixel.features[0], pixel.features[1]) = (x, y);
        tile.feature_variance[i][2..].fill(0.01 * roughness * roughness);
        pixel.colour = std::array::from_fn(|c| pixel.features[c + 3] + 0.3 * noise.next());
        pixel.weight = 1.0 + noise.next();
        pixel.variance = 0.02 * noise.next();
        pixel.tolerance = 0.05;
        pixel.state = PixelState::Noisy;
        if kind % 3 == 2 && noise.next() < 0.2 {
            (pixel.colour, pixel.weight) = ([0.0; 3], 0.0);
            pixel.state = PixelState::Bad;
        }
    }
    tile
}

/// The shortest digits that tell floats apart, and the sign of 0: all that the core computes, with one.
fn results(instruction_set: InstructionSet) -> Vec<String> {
    let mut noise = Noise(1);
    let mut colours = Box::new(ColourBlock::BLACK);
    noise.fill(colours.luminance.as_flattened_mut());
    noise.fill(colours.variance.as_flattened_mut());
    for good in colours.good.as_flattened_mut() {
        *good = if noise.next() < 0.1 { 0.0 } else { 1.0 };
    }
    let mut prepared = Box::new(WeightBlock::EMPTY);
    instruction_set.weigh_samples(&colours, &mut prepared);

    let mut group = Box::new(FeatureGroup::<3>::ZERO);
    noise.fill(group.value.as_flattened_mut().as_flattened_mut());
    noise.fill(group.variance.as_flattened_mut().as_flattened_mut());
    let mut filtered = Box::new(FilteredGroup::ZERO);
    let mut smoothed = Box::new(FilteredGroup::ZERO);
    assert!(instruction_set.prefilter(&group, &mut filtered, Some(&mut smoothed)));

    let mut noisy = Box::new(NoisyBlock::BLACK);
    noise.fill(noisy.colour.as_flattened_mut().as_flattened_mut());
    noise.fill(noisy.features.as_flattened_mut().as_flattened_mut());
    let mut of_features = Box::new(NoiseBlock::NONE);
    instruction_set.estimate_feature_noise(&noisy, &mut of_features);
    let mut of_colour = Box::new(NoiseBlock::NONE);
    instruction_set.estimate_colour_noise(&noisy, &mut of_colour);
    let mut of_further = [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT];
    instruction_set.estimate_further_noise(&noisy.colour[0], &mut of_further);

    let mut all = vec![
        format!("{prepared:?}"),
        format!("{filtered:?} {smoothed:?}"),
        format!("{of_features:?} {of_colour:?} {of_further:?}"),
    ];
    all.extend(finished(instruction_set, &mut noise));
    let known = |row: &mut Row<TILE_FEATURES>, params: &Params, scratch: &mut _| {
        instruction_set.denoise_cells(row, params, scratch);
    };
    all.extend(denoised(known, &mut noise));
    let wide = |row: &mut Row<WIDE_TILE_FEATURES>, params: &Params, scratch: &mut _| {
        instruction_set.denoise_wide_cells(row, params, scratch);
    };
    all.extend(denoised(wide, &mut noise));
    all
}

/// What becomes of cells of `D` features.
fn denoised<const D: usize>(
    denoise: impl Fn(&mut Row<D>, &Params, &mut Scratch<D, LANES>),
    noise: &mut Noise,
) -> Vec<String> {
    let mut scratch = Box::new(Scratch::<D, LANES>::new());
    let mut all = Vec::new();
    for params in [Params::default(), Params::literal(), Params::wlr()] {
        let mut row = Row::<D>::new(noise);
        denoise(&mut row, &params, &mut scratch);
        assert!(row.models.iter().all(|models| *models > 0));
        all.push(format!("{:?} {:?}", row.models, row.predictions));
        all.push(format!("{:?}", row.layers));
    }
    all
}

/// Rows of planes of noise.
struct Planes(Vec<Vec<f32>>);

impl Planes {
    fn new(noise: &mut Noise) -> Self {
        let mut planes = vec![vec![0.0; finish_columns(100)]; 100];
        noise.fill(planes.iter_mut().flatten());
        Self(planes)
    }

    /// `N` planes from the `first` on.
    fn from<const N: usize>(&self, first: usize) -> [&[f32]; N] {
        std::array::from_fn(|k| self.0[(first + k) % self.0.len()].as_slice())
    }

    /// `N` rows of them, `M` planes apart.
    fn rows<const N: usize, const M: usize>(&self, first: usize) -> [[&[f32]; M]; N] {
        std::array::from_fn(|k| self.from(first + M * k))
    }
}

/// What the stages after the blend make of rows of noise.
fn finished(instruction_set: InstructionSet, noise: &mut Noise) -> Vec<String> {
    let planes = Planes::new(noise);
    let [noisy, good, own, variance, level] = planes.from(0);
    let mut results: [Vec<f32>; 5] = std::array::from_fn(|_| vec![0.0; finish_columns(100)]);
    let mut all = Vec::new();
    for pass in SMOOTHINGS {
        let input = Surroundings {
            colour: planes.rows(5),
            error: planes.from(14),
            level,
            noisy,
            features: planes.rows(20),
            feature_variance: planes.from(41),
        };
        let [takes_part, colour, features @ ..] = results.each_mut().map(Vec::as_mut_slice);
        let mut output = Precisions {
            takes_part,
            colour,
            features,
        };
        instruction_set.weigh_pixels(&pass, &input, &mut output);
        all.push(format!("{results:?}"));
        let rows = std::array::from_fn(|k| ComparedRow {
            takes_part: noisy,
            colour: planes.from(3 * k),
            colour_precision: own,
            features: planes.from(30 + 7 * k),
            feature_precision: planes.from(80 + 2 * k),
        });
        let mut smoothed = [FinishedPlane {
            rows: planes.from(7),
            output: &mut results[0],
        }];
        instruction_set.smooth(&pass, &rows, &mut smoothed);
        all.push(format!("{smoothed:?}"));
    }
    let input = SpeckRow {
        colour: planes.rows(5),
        noisy,
        good,
        own,
        variance,
    };
    let mut cleared = [FinishedPlane {
        rows: planes.from(5),
        output: &mut results[0],
    }];
    instruction_set.despeckle(&input, &mut cleared);
    all.push(format!("{cleared:?}"));
    let [lost, light, noise, factors, _] = results.each_mut().map(Vec::as_mut_slice);
    let input = LitRow {
        colour: planes.from(5),
        noisy,
        good,
        own,
        variance,
    };
    instruction_set.compare_light(&input, [lost, light, noise]);
    instruction_set.find_factors(&planes.rows(10), noisy, factors);
    all.push(format!("{results:?}"));
    all
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let expected = results(InstructionSet::BASELINE);
    for instruction_set in instruction_sets() {
        for (i, (own, expected)) in results(instruction_set).iter().zip(&expected).enumerate() {
            assert!(own == expected, "{instruction_set:?} in result {i}");
        }
    }
}
