//! Smoothing, despeckling and the light given back, which the core works out in runs of columns, against their formulas in double
//! precision, pixel by pixel.

use linpred_core::{
    ComparedRow, DESPECKLE_SPAN, FINISH_PADDING, FinishedPlane, LIGHT_PLANES, LitRow, Precisions,
    RESTORE_SPAN, SMOOTH_SPAN, SMOOTHINGS, Smoothing, SpeckRow, Surroundings, compare_light,
    despeckle, find_factors, finish_columns, level_of, smooth, weigh_pixels,
};
use linpred_tests::images::noise;
use linpred_tests::tolerance::{FINISH, close};

const WIDTH: usize = 71;
const HEIGHT: usize = 45;

/// A plane of an image, whose rows have columns beyond it.
#[derive(Clone)]
struct Plane(Vec<Vec<f32>>);

impl Plane {
    fn new(value: impl Fn(usize, usize) -> f32) -> Self {
        let mut plane = Self(vec![vec![0.0; finish_columns(WIDTH)]; HEIGHT]);
        for (y, row) in plane.0.iter_mut().enumerate() {
            for x in 0..WIDTH {
                row[FINISH_PADDING + x] = value(x, y);
            }
        }
        plane.pad();
        plane
    }

    fn pad(&mut self) {
        for row in &mut self.0 {
            let (first, last) = (row[FINISH_PADDING], row[FINISH_PADDING + WIDTH - 1]);
            row[..FINISH_PADDING].fill(first);
            row[FINISH_PADDING + WIDTH..].fill(last);
        }
    }

    fn pad_with_zeros(&mut self) {
        for row in &mut self.0 {
            row[..FINISH_PADDING].fill(0.0);
            row[FINISH_PADDING + WIDTH..].fill(0.0);
        }
    }

    /// Row `y`, or the nearest.
    fn row(&self, y: isize) -> &[f32] {
        &self.0[y.clamp(0, HEIGHT as isize - 1) as usize]
    }

    /// The value at (x, y), or of the nearest pixel.
    fn at(&self, x: isize, y: isize) -> f64 {
        let x = x.clamp(0, WIDTH as isize - 1) as usize;
        f64::from(self.row(y)[FINISH_PADDING + x])
    }

    fn mean(&self, x: isize, y: isize, radius: isize) -> f64 {
        let span = 2 * radius + 1;
        let rows = y - radius..=y + radius;
        let sum: f64 = rows
            .flat_map(|y| (x - radius..=x + radius).map(move |x| self.at(x, y)))
            .sum();
        sum / (span * span) as f64
    }
}

/// An image after the blend.
struct Image {
    colour: [Plane; 3],
    error: Plane,
    level: Plane,
    noisy: Plane,
    features: [Plane; 7],
    feature_variance: [Plane; 3],
    own: Plane,
    variance: Plane,
    good: Plane,
}

/// An edge in the features, a ramp in the depth, specks, clean pixels, negative ones, ones that were not finite and ones without an error.
fn image() -> Image {
    let grain = |seed: u32, x: usize, y: usize| noise(seed, y * WIDTH + x);
    let edge = |x: usize, y: usize| if 2 * x + y > 75 { 1.0 } else { 0.0 };
    let radiance = |c: u32| {
        move |x: usize, y: usize| {
            let speck = match (x * 7 + y * 11) % 97 {
                0 => 4.0,
                1 => 0.05,
                2 => 0.0,
                3 => -0.1,
                _ => 1.0,
            };
            (0.4 + 0.5 * edge(x, y) + 0.03 * grain(c, x, y)) * speck
        }
    };
    let feature = |k: u32| {
        move |x: usize, y: usize| {
            let slope = if k == 6 { 3.0 + 0.02 * x as f32 } else { 0.3 };
            slope + 0.3 * edge(x, y) + 0.01 * grain(10 + k, x, y)
        }
    };
    Image {
        colour: [0, 1, 2].map(|c| Plane::new(radiance(c))),
        error: Plane::new(|x, y| if x > 60 { 0.0 } else { 1e-3 * grain(20, x, y) }),
        level: Plane::new(|x, y| level_of(1.0 + grain(21, x, y))),
        noisy: Plane::new(|x, y| if (x + y) % 13 == 0 { 0.0 } else { 1.0 }),
        features: [0, 1, 2, 3, 4, 5, 6].map(|k| Plane::new(feature(k))),
        feature_variance: [30, 31, 32].map(|seed| Plane::new(|x, y| 1e-4 * grain(seed, x, y))),
        own: Plane::new(|x, y| 0.6 + 0.8 * (grain(22, x, y) - 0.5)),
        variance: Plane::new(|x, y| 0.3 * grain(23, x, y)),
        good: Plane::new(|x, y| if (x * 3 + y) % 17 == 0 { 0.0 } else { 1.0 }),
    }
}

fn pixels() -> impl Iterator<Item = (isize, isize)> {
    (0..HEIGHT as isize).flat_map(|y| (0..WIDTH as isize).map(move |x| (x, y)))
}

/// Precisions of a pass: whether a pixel takes part, and those of colour, normal, albedo, depth.
struct Weighed {
    takes_part: Plane,
    precisions: [Plane; 4],
}

fn weighed(image: &Image, pass: &Smoothing) -> Weighed {
    let zeros = || Plane::new(|_, _| 0.0);
    let mut weighed = Weighed {
        takes_part: zeros(),
        precisions: [(); 4].map(|()| zeros()),
    };
    for y in 0..HEIGHT as isize {
        let three = |k: usize| y + k as isize - 1;
        let input = Surroundings {
            colour: std::array::from_fn(|k| image.colour.each_ref().map(|c| c.row(three(k)))),
            error: std::array::from_fn(|k| image.error.row(y + k as isize - 2)),
            level: image.level.row(y),
            noisy: image.noisy.row(y),
            features: std::array::from_fn(|k| image.features.each_ref().map(|c| c.row(three(k)))),
            feature_variance: image.feature_variance.each_ref().map(|v| v.row(y)),
        };
        let [colour, features @ ..] = weighed
            .precisions
            .each_mut()
            .map(|p| &mut p.0[y as usize][..]);
        let takes_part = &mut weighed.takes_part.0[y as usize][..];
        weigh_pixels(
            pass,
            &input,
            &mut Precisions {
                takes_part,
                colour,
                features,
            },
        );
    }
    weighed.takes_part.pad_with_zeros();
    weighed
}

impl Image {
    fn defined(&self, pass: &Smoothing, x: isize, y: isize) -> (bool, [f64; 4]) {
        let strength = f64::from(pass.strength);
        let radiance: f64 = [-1, 0, 1]
            .into_iter()
            .flat_map(|dy| [-1, 0, 1].map(|dx| (x + dx, y + dy)))
            .flat_map(|(x, y)| self.colour.each_ref().map(|c| c.at(x, y).abs()))
            .sum();
        let mean = radiance / 27.0 + 0.1 * self.level.at(x, y);
        let error = f64::from(pass.error_left) * self.error.mean(x, y, 2) / (mean * mean);
        let grain = error.min(0.04);
        let [normal, albedo, depth] = self.feature_variance.each_ref().map(|v| 2.0 * v.at(x, y));
        let z = &self.features[6];
        let slope = ((z.at(x + 1, y) - z.at(x - 1, y)).powi(2)
            + (z.at(x, y + 1) - z.at(x, y - 1)).powi(2))
            / 4.0;
        let apart = ((3 * pass.step).pow(2) as f64 / 2.0).max(1.0);
        let spreads = [
            6.0 * mean * mean * grain,
            normal + 0.08f64.powi(2),
            albedo + 0.015f64.powi(2),
            depth + slope * apart + (0.05 * z.at(x, y)).powi(2),
        ];
        let positive = self.colour.iter().all(|c| c.at(x, y) >= 0.0);
        let takes_part = positive && error > 0.0 && self.noisy.at(x, y) > 0.0;
        (takes_part, spreads.map(|spread| strength * 0.5 / spread))
    }
}

#[test]
fn precisions_of_colours_and_features() {
    let image = image();
    for pass in SMOOTHINGS {
        let weighed = weighed(&image, &pass);
        let mut apart = 0;
        for (x, y) in pixels() {
            let (takes_part, expected) = image.defined(&pass, x, y);
            assert_eq!(weighed.takes_part.at(x, y) > 0.0, takes_part, "{x} {y}");
            for (k, expected) in expected.into_iter().enumerate() {
                let own = weighed.precisions[k].at(x, y);
                let off = close(own, expected, FINISH * expected);
                assert!(
                    off || (k == 0 && !takes_part),
                    "{x} {y} {k}: {own} {expected}"
                );
            }
            apart += usize::from(!takes_part);
        }
        assert!(apart > 500 && apart < WIDTH * HEIGHT / 2, "{apart}");
    }
}

/// The planes of an image that are smoothed: the colours, and a layer.
fn smoothed(image: &Image, pass: &Smoothing, weighed: &Weighed, planes: &[Plane]) -> Vec<Plane> {
    let zeros = vec![0.0; finish_columns(WIDTH)];
    let mut outputs = vec![Plane::new(|_, _| 0.0); planes.len()];
    for y in 0..HEIGHT as isize {
        let number = |k: usize| y + (k as isize - 3) * pass.step as isize;
        let rows: [ComparedRow<'_>; SMOOTH_SPAN] = std::array::from_fn(|k| {
            let y = number(k);
            if y < 0 || y >= HEIGHT as isize {
                return ComparedRow::outside(&zeros);
            }
            let [colour_precision, feature_precision @ ..] =
                weighed.precisions.each_ref().map(|p| p.row(y));
            ComparedRow {
                takes_part: weighed.takes_part.row(y),
                colour: image.colour.each_ref().map(|c| c.row(y)),
                colour_precision,
                features: image.features.each_ref().map(|f| f.row(y)),
                feature_precision,
            }
        });
        let planes = planes
            .iter()
            .zip(&mut outputs)
            .map(|(plane, output)| FinishedPlane {
                rows: std::array::from_fn(|k| plane.row(number(k))),
                output: &mut output.0[y as usize],
            });
        smooth(pass, &rows, &mut planes.collect::<Vec<_>>());
    }
    outputs
}

impl Image {
    /// The weight of pixel j in the mean of pixel i.
    fn weight(&self, weighed: &Weighed, i: (isize, isize), j: (isize, isize)) -> f64 {
        let square = |planes: &[Plane]| {
            let squares = planes
                .iter()
                .map(|p| (p.at(i.0, i.1) - p.at(j.0, j.1)).powi(2));
            squares.sum::<f64>()
        };
        let squares = [
            square(&self.colour),
            square(&self.features[..3]),
            square(&self.features[3..6]),
            square(&self.features[6..]),
        ];
        let terms = squares.iter().zip(&weighed.precisions);
        let distance: f64 = terms
            .map(|(s, p)| s * (p.at(i.0, i.1) + p.at(j.0, j.1)))
            .sum();
        (1.0 - distance / 8.0).max(0.0).powi(8)
    }

    fn mean(&self, weighed: &Weighed, plane: &Plane, step: isize, (x, y): (isize, isize)) -> f64 {
        let inside = |(x, y): &(isize, isize)| {
            (0..WIDTH as isize).contains(x) && (0..HEIGHT as isize).contains(y)
        };
        let neighbours =
            (-3..=3).flat_map(|dy| (-3..=3).map(move |dx| (x + dx * step, y + dy * step)));
        let (mut sum, mut weights) = (0.0, 0.0);
        for j in neighbours.filter(inside) {
            let weight = weighed.takes_part.at(j.0, j.1) * self.weight(weighed, (x, y), j);
            sum += weight * plane.at(j.0, j.1);
            weights += weight;
        }
        sum / weights
    }
}

#[test]
fn smoothed_planes_are_means_of_their_neighbours() {
    let image = image();
    let layer = Plane::new(|x, y| noise(40, y * WIDTH + x));
    for pass in SMOOTHINGS {
        let weighed = weighed(&image, &pass);
        let planes = [image.colour[1].clone(), layer.clone()];
        let outputs = smoothed(&image, &pass, &weighed, &planes);
        let mut changed = 0;
        for (output, plane) in outputs.iter().zip(&planes) {
            for (x, y) in pixels() {
                let (own, before) = (output.at(x, y), plane.at(x, y));
                if weighed.takes_part.at(x, y) > 0.0 {
                    let expected = image.mean(&weighed, plane, pass.step as isize, (x, y));
                    assert!(
                        close(own, expected, FINISH * expected.abs()),
                        "{x} {y}: {own} {expected}"
                    );
                    changed += usize::from(own != before);
                } else {
                    assert!(own.to_bits() == before.to_bits(), "{x} {y}");
                }
            }
        }
        assert!(changed > WIDTH * HEIGHT, "{changed}");
    }
}

fn cleared(image: &Image, planes: &[Plane]) -> Vec<Plane> {
    let mut outputs = planes.to_vec();
    for y in 0..HEIGHT as isize {
        let three: [isize; DESPECKLE_SPAN] = [y - 1, y, y + 1];
        let input = SpeckRow {
            colour: three.map(|y| image.colour.each_ref().map(|c| c.row(y))),
            noisy: image.noisy.row(y),
            good: image.good.row(y),
            own: image.own.row(y),
            variance: image.variance.row(y),
        };
        let planes = planes
            .iter()
            .zip(&mut outputs)
            .map(|(plane, output)| FinishedPlane {
                rows: three.map(|y| plane.row(y)),
                output: &mut output.0[y as usize],
            });
        despeckle(&input, &mut planes.collect::<Vec<_>>());
    }
    outputs
}

impl Image {
    fn level(&self, (x, y): (isize, isize)) -> f64 {
        self.colour.iter().map(|c| c.at(x, y)).sum::<f64>() / 3.0
    }

    /// What a plane's pixel becomes, and whether it was a speck.
    fn cleared(&self, plane: &Plane, (x, y): (isize, isize)) -> (f64, bool) {
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        let around: Vec<_> = around.filter(|j| *j != (x, y)).collect();
        let levels: Vec<f64> = around.iter().map(|j| self.level(*j)).collect();
        let most = 1.15
            * levels
                .iter()
                .copied()
                .fold(f64::NEG_INFINITY, f64::max)
                .max(0.0);
        let least = levels.iter().copied().fold(f64::INFINITY, f64::min) / 1.15;
        let (level, own) = (self.level((x, y)), self.own.at(x, y));
        let deviation = (self.variance.at(x, y) / 3.0).sqrt();
        let mute = self.good.at(x, y) == 0.0;
        let value = plane.at(x, y);
        let whole = self.colour.iter().all(|c| c.at(x, y) >= 0.0);
        if self.noisy.at(x, y) == 0.0 {
            (value, false)
        } else if whole && level > most && (mute || own - most < 2.0 * deviation) {
            (value * most / level, true)
        } else if level < least && least > 0.0 && (mute || least - own < 2.0 * deviation) {
            let neighbours: f64 = around.iter().map(|j| plane.at(j.0, j.1)).sum();
            let scaled = if whole && level > 0.05 * least {
                value * least / level
            } else {
                neighbours * least / levels.iter().sum::<f64>()
            };
            (scaled, true)
        } else {
            (value, false)
        }
    }
}

#[test]
fn specks_become_what_their_neighbours_allow() {
    let image = image();
    let outputs = cleared(&image, &image.colour);
    let mut specks = 0;
    for (output, plane) in outputs.iter().zip(&image.colour) {
        for (x, y) in pixels() {
            let (expected, speck) = image.cleared(plane, (x, y));
            let own = output.at(x, y);
            assert!(
                close(own, expected, FINISH * expected.abs()),
                "{x} {y}: {own} {expected}"
            );
            assert!(
                speck || own.to_bits() == plane.at(x, y).to_bits(),
                "{x} {y}"
            );
            specks += usize::from(speck);
        }
    }
    assert!(specks > 100, "{specks}");
}

#[test]
fn factors_give_back_the_light_that_is_lost_around() {
    let image = image();
    let counts = Plane::new(|x, y| {
        (image.noisy.row(y as isize)[FINISH_PADDING + x])
            * image.good.row(y as isize)[FINISH_PADDING + x]
    });
    let mut light = [(); LIGHT_PLANES].map(|()| Plane::new(|_, _| 0.0));
    for y in 0..HEIGHT as isize {
        let input = LitRow {
            colour: image.colour.each_ref().map(|c| c.row(y)),
            noisy: image.noisy.row(y),
            good: image.good.row(y),
            own: image.own.row(y),
            variance: image.variance.row(y),
        };
        compare_light(&input, light.each_mut().map(|p| &mut p.0[y as usize][..]));
    }
    light.iter_mut().for_each(Plane::pad);
    let value = |f: &dyn Fn(isize, isize) -> f64| {
        Plane::new(|x, y| (counts.at(x as isize, y as isize) * f(x as isize, y as isize)) as f32)
    };
    let lost = value(&|x, y| image.own.at(x, y) - image.level((x, y)));
    let there = value(&|x, y| image.level((x, y)));
    let noise = value(&|x, y| image.variance.at(x, y) / 3.0);
    let mut factors = vec![0.0; finish_columns(WIDTH)];
    let mut restored = 0;
    for y in 0..HEIGHT as isize {
        let planes: [[_; RESTORE_SPAN]; LIGHT_PLANES] = light
            .each_ref()
            .map(|plane| std::array::from_fn(|k| plane.row(y + k as isize - 16)));
        find_factors(&planes, image.noisy.row(y), &mut factors);
        for x in 0..WIDTH as isize {
            let own = f64::from(factors[FINISH_PADDING + x as usize]);
            let near = |d: isize| (17 - d.abs()) as f64;
            let sum = |plane: &Plane, power: i32| {
                let rows = (-16..=16).flat_map(|dy| (-16..=16).map(move |dx| (dx, dy)));
                let weighed = rows
                    .map(|(dx, dy)| (near(dx) * near(dy)).powi(power) * plane.at(x + dx, y + dy));
                weighed.sum::<f64>()
            };
            let (r, d, q) = (sum(&lost, 1), sum(&there, 1), sum(&noise, 2));
            let factor = (1.0 + r * r / (r * r + q) * r / d).clamp(0.5, 2.0);
            let expected = if image.noisy.at(x, y) > 0.0 {
                factor
            } else {
                1.0
            };
            assert!(close(own, expected, FINISH), "{x} {y}: {own} {expected}");
            restored += usize::from((own - 1.0).abs() > 1e-3);
        }
    }
    assert!(restored > WIDTH * HEIGHT / 2, "{restored}");
}
