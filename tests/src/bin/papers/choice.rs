//! How wide models may predict: the half-width by the estimate beside that by the reference (LPR section 4.2, Fig. 4).

use linpred_core::{CELL, HALO, Params, Quality, TILE};
use linpred_tests::definition::{Model, Window};
use linpred_tests::windows::pixels_within;

use crate::picture::{Cell, Picture, Prepared, Reference};
use crate::statistics::{correlation, mean, rank_correlation};

/// Every so many pixels of a picture, in either direction, are centres.
const STRIDE: usize = 7;

/// What is chosen for one centre.
#[derive(Clone, Copy, Debug)]
struct Choice {
    /// Which cell the centre is in.
    cell: usize,
    /// Half-width with the least estimated error, and with the least true one.
    estimated: usize,
    reference: usize,
    /// The same without r = 0, whose true error is that of one pixel and may be small by chance.
    wider: [usize; 2],
    /// True mean squared error over the prediction window of either, and of the pixel itself.
    error: f64,
    least_error: f64,
    own_error: f64,
    /// Estimated and true error at the largest half-width.
    widest: [f64; 2],
}

/// A way to choose: whose fits, with which features, by which estimate.
#[derive(Clone, Copy, Debug)]
struct Way {
    name: &'static str,
    params: Params,
    prefiltered: bool,
    /// Whether the pixels' variances are taken off the literal estimate from r = 1 on, as robust fits do.
    noise_off: bool,
}

fn ways() -> [Way; 4] {
    let literal = Way {
        name: "literal",
        params: Params::literal(),
        prefiltered: true,
        noise_off: false,
    };
    [
        literal,
        Way {
            name: "literal, features as rendered",
            prefiltered: false,
            ..literal
        },
        Way {
            name: "literal, noise taken off the estimate",
            noise_off: true,
            ..literal
        },
        Way {
            name: "robust",
            params: Params::new(Quality::Fast),
            ..literal
        },
    ]
}

/// Columns of [`rows`].
pub(crate) const COLUMNS: &str = "way,centres,correlation,correlation of cells,correlation from r = 1 on,correlation of cells from r = 1 on,rank correlation,mean k,mean k of the reference,own pixel,own pixel of the reference,error over the reference's choice,\
    own error over the reference's choice,widest: correlation of logarithms,reference choices of two renders,estimate with the other render's reference";

/// A line for each way. With the `other` render of as many samples, also how alike the reference's choices are of two renders.
pub(crate) fn rows(
    picture: &Picture,
    other: Option<&Picture>,
    reference: &Reference,
) -> Vec<String> {
    let each = ways().into_iter();
    each.map(|way| {
        let own = choices(picture, reference, way);
        let others = other.map(|other| choices(other, reference, way));
        row(way, &own, others.as_deref())
    })
    .collect()
}

fn row(way: Way, own: &[Choice], others: Option<&[Choice]>) -> String {
    let k = |radius: usize| pixels_within(radius) as f64;
    let estimated: Vec<f64> = own.iter().map(|c| k(c.estimated)).collect();
    let reference: Vec<f64> = own.iter().map(|c| k(c.reference)).collect();
    let wider = |i: usize| -> Vec<f64> { own.iter().map(|c| k(c.wider[i])).collect() };
    let sum = |of: fn(&Choice) -> f64| own.iter().map(of).sum::<f64>();
    let share = |of: fn(&Choice) -> usize| {
        own.iter().filter(|c| of(c) == 0).count() as f64 / own.len() as f64
    };
    let logarithms = |i: usize| -> Vec<f64> {
        let widest = own.iter().filter(|c| c.widest.iter().all(|v| *v > 0.0));
        widest.map(|c| c.widest[i].ln()).collect()
    };
    let alike = |of: fn(&Choice) -> usize| {
        others.map(|others| {
            let theirs: Vec<f64> = others.iter().map(|c| k(c.reference)).collect();
            let ours: Vec<f64> = own.iter().map(|c| k(of(c))).collect();
            correlation(&ours, &theirs)
        })
    };
    let figures = [
        Some(correlation(&estimated, &reference)),
        Some(correlation(
            &over_cells(own, &estimated),
            &over_cells(own, &reference),
        )),
        Some(correlation(&wider(0), &wider(1))),
        Some(correlation(
            &over_cells(own, &wider(0)),
            &over_cells(own, &wider(1)),
        )),
        Some(rank_correlation(&estimated, &reference)),
        Some(mean(&estimated)),
        Some(mean(&reference)),
        Some(share(|c| c.estimated)),
        Some(share(|c| c.reference)),
        Some(sum(|c| c.error) / sum(|c| c.least_error)),
        Some(sum(|c| c.own_error) / sum(|c| c.least_error)),
        Some(correlation(&logarithms(0), &logarithms(1))),
        alike(|c| c.reference),
        alike(|c| c.estimated),
    ];
    let figures = figures.map(|v| v.map_or(String::new(), |v| format!("{v:.4}")));
    format!("\"{}\",{},{}", way.name, own.len(), figures.join(","))
}

/// Means over the centres of each cell: a map of sizes as it is seen from afar.
fn over_cells(choices: &[Choice], sizes: &[f64]) -> Vec<f64> {
    let each: Vec<(usize, f64)> = choices
        .iter()
        .map(|c| c.cell)
        .zip(sizes.iter().copied())
        .collect();
    let cells = each.chunk_by(|a, b| a.0 == b.0);
    cells
        .map(|cell| mean(&cell.iter().map(|(_, size)| *size).collect::<Vec<_>>()))
        .collect()
}

fn choices(picture: &Picture, reference: &Reference, way: Way) -> Vec<Choice> {
    let prepared = Prepared::new(picture, way.prefiltered);
    let cells = prepared.cells();
    let centres = cells.iter().enumerate().flat_map(|(number, cell)| {
        let rows = (HALO..HALO + CELL).step_by(STRIDE);
        rows.flat_map(|y| {
            (HALO..HALO + CELL)
                .step_by(STRIDE)
                .map(move |x| y * TILE + x)
        })
        .filter(|position| cell.holds(*position))
        .map(move |position| (number, cell, position))
    });
    centres
        .filter_map(|(number, cell, position)| choose(number, cell, position, reference, way))
        .collect()
}

/// `None` around a pixel without noise: there is nothing to choose.
fn choose(
    number: usize,
    cell: &Cell,
    position: usize,
    reference: &Reference,
    way: Way,
) -> Option<Choice> {
    if cell.tile.pixels[position].variance == 0.0 {
        return None;
    }
    let window = Window::new(&cell.tile, position, way.params);
    let models = window.models();
    let mut noise = noise_within(cell, &window).into_iter();
    let candidates: Vec<Candidate> = models
        .iter()
        .map(|model| {
            let mut risk = model.risk;
            let mean_noise = noise.next().unwrap_or(0.0);
            if way.noise_off && model.radius > 0 {
                risk -= mean_noise;
            }
            (
                model.radius,
                risk,
                true_error(cell, &window, model, reference),
            )
        })
        .collect();
    let (estimated, _, error) = least(&candidates, |c| c.1)?;
    let (chosen, _, least_error) = least(&candidates, |c| c.2)?;
    let wider = candidates.get(1..)?;
    let widest = candidates.last()?;
    Some(Choice {
        cell: number,
        estimated,
        reference: chosen,
        wider: [least(wider, |c| c.1)?.0, least(wider, |c| c.2)?.0],
        error,
        least_error,
        own_error: candidates.first()?.2,
        widest: [widest.1, widest.2 * window.squared_scale()],
    })
}

/// Half-width, estimated and true error.
type Candidate = (usize, f64, f64);

/// The first with the least of a figure.
fn least(candidates: &[Candidate], of: fn(&Candidate) -> f64) -> Option<Candidate> {
    let each = candidates.iter().copied();
    each.min_by(|a, b| of(a).total_cmp(&of(b)))
}

/// Mean variance of the pixels within each half-width, in the unit of the window's risks.
fn noise_within(cell: &Cell, window: &Window) -> Vec<f64> {
    let variances: Vec<f64> = window
        .regressors()
        .map(|(position, _)| f64::from(cell.tile.pixels[position].variance))
        .collect();
    (0..=9)
        .map(|radius| mean(&variances[..pixels_within(radius)]) * window.squared_scale())
        .collect()
}

/// Mean squared error over the pixels of the prediction window (LPR Eq. 2), summed over the channels.
fn true_error(cell: &Cell, window: &Window, model: &Model, reference: &Reference) -> f64 {
    let inside = window
        .radiance(model)
        .filter(|(position, _)| cell.holds(*position));
    let errors: Vec<f64> = inside
        .map(|(position, radiance)| reference.squared_error(cell.pixel(position), &radiance))
        .collect();
    mean(&errors)
}
