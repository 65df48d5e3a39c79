//! A frame in memory gives each channel its own pixels, says what it holds, and refuses what does not fit in a sentence.

use linpred::image::{Frame, Interleaved, Pixels};
use linpred::{Error, Feature, ImageSize, InputRow, RowSource, VarianceKind};

const WIDTH: usize = 5;
const HEIGHT: usize = 4;

fn size() -> ImageSize {
    ImageSize::new(WIDTH, HEIGHT).unwrap()
}

/// Pixels whose every value tells which it is.
struct Numbered {
    seed: usize,
    size: (usize, usize),
    channels: usize,
}

/// Those of the image's size.
fn numbered(seed: usize, channels: usize) -> Numbered {
    Numbered {
        seed,
        size: (WIDTH, HEIGHT),
        channels,
    }
}

fn value(seed: usize, channel: usize, x: usize, y: usize) -> f32 {
    (seed * 1000 + channel * 100 + y * 10 + x) as f32
}

impl Pixels for Numbered {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn channels(&self) -> usize {
        self.channels
    }

    fn read_row(&self, channel: usize, y: usize, row: &mut [f32]) {
        for (x, v) in row.iter_mut().enumerate() {
            *v = value(self.seed, channel, x, y);
        }
    }
}

/// The value in the middle of row 3.
fn in_row_three(seed: usize, channel: usize) -> f32 {
    value(seed, channel, 2, 3)
}

#[test]
fn each_plane_of_a_row_holds_its_own_pixels() {
    let mut frame = Frame::new(numbered(1, 3))
        .and_then(|frame| frame.with_variance(numbered(2, 3)))
        .and_then(|frame| {
            let albedo = Feature::Albedo;
            frame.with_feature_and_variance(albedo, numbered(3, 3), numbered(4, 3))
        })
        .and_then(|frame| frame.with_feature(Feature::Depth, numbered(5, 1)))
        .and_then(|frame| frame.with_layer("diffuse", numbered(6, 3)))
        .and_then(|frame| frame.with_layer("specular", numbered(7, 3)))
        .and_then(|frame| frame.with_alpha(numbered(8, 1)))
        .and_then(|frame| frame.with_scalar("mask", numbered(9, 1)))
        .unwrap();
    let layout = frame.layout();
    assert_eq!(layout.variance, VarianceKind::OfMean);
    assert_eq!((layout.layers, layout.alpha, layout.scalars), (2, true, 1));
    let mut row = InputRow::new(&layout);
    frame.read_row(3, &mut row).unwrap();
    assert!(row.fits(&layout));
    for channel in 0..3 {
        let at = |planes: &[Vec<f32>]| planes[channel][2];
        assert_eq!(at(&row.colour), in_row_three(1, channel));
        assert_eq!(at(&row.variance), in_row_three(2, channel));
        assert_eq!(
            at(&row.features[Feature::Albedo.range()]),
            in_row_three(3, channel)
        );
        assert_eq!(
            at(&row.feature_variances[Feature::Albedo.range()]),
            in_row_three(4, channel)
        );
        assert_eq!(at(&row.layers[0]), in_row_three(6, channel));
        assert_eq!(at(&row.layers[1]), in_row_three(7, channel));
    }
    assert_eq!(
        row.features[Feature::Depth.range()][0][2],
        in_row_three(5, 0)
    );
    assert_eq!(row.alpha[2], in_row_three(8, 0));
    assert_eq!(row.scalars[0][2], in_row_three(9, 0));
    assert!(row.features[Feature::Normal.range()][0].is_empty());
}

#[test]
fn halves_give_the_variance_of_their_mean() {
    let (a, b) = (vec![[1.0; 3]; 20], vec![[4.0, 1.0, 2.0]; 20]);
    let mean = vec![[2.5, 1.0, 1.5]; 20];
    let pixels = |pixels| Interleaved::new(size(), pixels).unwrap();
    let mut frame = Frame::new(pixels(&mean))
        .and_then(|frame| frame.with_halves(pixels(&a), pixels(&b)))
        .unwrap();
    assert_eq!(frame.layout().variance, VarianceKind::OfHalves);
    let mut row = InputRow::new(&frame.layout());
    frame.read_row(0, &mut row).unwrap();
    assert_eq!(row.colour[0], [2.5; WIDTH]);
    let variances = [2.25, 0.0, 0.25].map(|v| vec![v; WIDTH]);
    assert_eq!(row.variance, variances);
}

#[test]
fn a_variance_below_zero_is_none() {
    let (colour, mut variance) = (vec![[1.0; 3]; 20], vec![[0.5; 3]; 20]);
    variance[2][1] = -0.5;
    let pixels = |pixels| Interleaved::new(size(), pixels).unwrap();
    let mut frame = Frame::new(pixels(&colour))
        .and_then(|frame| frame.with_variance(pixels(&variance)))
        .unwrap();
    let mut row = InputRow::new(&frame.layout());
    frame.read_row(0, &mut row).unwrap();
    assert!(row.variance[1][2].is_nan());
    assert_eq!(row.variance[1][1], 0.5);
}

#[test]
fn what_does_not_fit_is_refused_with_its_name_and_size() {
    let refused = |result: Result<Frame<'_>, Error>| match result {
        Err(Error::Usage(reason)) => reason,
        other => panic!("{other:?}"),
    };
    let of_size = |width, height| Numbered {
        seed: 0,
        size: (width, height),
        channels: 3,
    };
    for empty in [of_size(0, 4), of_size(5, 0)] {
        assert!(refused(Frame::new(empty)).contains("no image"));
    }
    assert_eq!(
        refused(Frame::new(numbered(0, 4))),
        "colour: 4 channels, not 3"
    );
    let frame = || Frame::new(numbered(0, 3)).unwrap();
    let turned = frame().with_feature(Feature::Normal, of_size(4, 5));
    assert_eq!(
        refused(turned),
        "normal: 4 x 5 pixels, but the colour has 5 x 4"
    );
    let deep = frame().with_feature(Feature::Depth, numbered(0, 3));
    assert_eq!(refused(deep), "depth: 3 channels, not 1");
    let twice = frame()
        .with_feature(Feature::Depth, numbered(0, 1))
        .and_then(|frame| frame.with_feature(Feature::Depth, numbered(0, 1)));
    assert_eq!(refused(twice), "depth is given twice");
    let too_few = Interleaved::new(size(), &[[0.0; 3]; 19]);
    assert!(matches!(too_few, Err(Error::Usage(reason)) if reason.starts_with("19 pixels")));
}
