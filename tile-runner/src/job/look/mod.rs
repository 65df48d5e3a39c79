//! A look at some of an image's rows before it is denoised: whether its variances are some, its halves are of one picture, its pixels share samples, its ends
//! meet, and whether all of it was rendered.
//!
//! It depends on the file alone, so bands of an image agree on what they find. The one thing that takes all rows, once, is what was rendered of an image whose first
//! or last row or column is empty.

mod edges;
mod halves;
mod pixels;

use std::ops::Range;

use crate::channels::variance::{Count, Variance};
use crate::error::{Error, Setting};
use crate::image::area::Area;
use crate::job::input::Input;
use crate::job::look::edges::{Seam, rendered_area};
use crate::job::look::halves::HalvesLook;
use crate::job::look::pixels::PixelsLook;
use crate::job::request::Wrap;
use crate::job::{memory, plan};
use crate::row::{InputRow, RowSource};

/// Rows of an image no higher than this are all looked at.
const ALL_ROWS: usize = 128;
/// Of higher ones so many strips.
const STRIPS: usize = 5;
/// Rows of each: what most compressions store in one piece.
pub(super) const STRIP: usize = 16;

/// What was found.
#[derive(Debug)]
pub(super) struct Findings {
    /// Whether a variance of 0 says that nothing is known.
    pub(super) zero_is_unknown: bool,
    /// Whether the two halves of the samples are one picture.
    pub(super) halves_are_one: bool,
    /// What of the image was rendered, if not all of it.
    pub(super) area: Option<Area>,
    /// Whether the left and right ends of the picture meet.
    pub(super) wrap: bool,
    /// What a user should know.
    pub(super) warnings: Vec<String>,
    /// What is worth a word.
    pub(super) notes: Vec<String>,
    /// Why the image cannot be denoised.
    pub(super) problem: Option<Error>,
}

/// Looks at an input within `limit` bytes of memory. Errors are those of reading it.
pub(super) fn look(input: &Input, wrap: Wrap, limit: u64) -> Result<Findings, Error> {
    let plan = plan::look_plan(input);
    plan.check(limit)?;
    memory::check_available(&plan, 1)?;
    let mut source = input.source(limit)?;
    if let Some(samples) = &input.roles.samples
        && let Count::Channel { .. } = samples.count
    {
        // what has samples was rendered, however dark it came out
        source = source.with_samples(samples.count);
    }
    let layout = source.layout();
    let mut row = InputRow::new(&layout);
    let stated = matches!(input.roles.variance, Variance::Given { .. });
    let (mut pixels, mut seam) = (PixelsLook::new(&layout, stated), Seam::default());
    let strips = strips(input, layout.size.height());
    for strip in &strips {
        for y in strip.clone() {
            source.read_row(y, &mut row)?;
            pixels.add_row(&row);
            seam.add_row(&row);
        }
        pixels.end_strip();
    }
    let mut may_be_part = pixels.has_empty_side();
    for y in [0, layout.size.height() - 1] {
        source.read_row(y, &mut row)?;
        may_be_part |= edges::is_empty(&row, 0..layout.size.width());
    }
    let halves = halves::look(input, &strips, limit)?;
    let halves_are_one = halves.as_ref().is_some_and(HalvesLook::are_one);
    let area = match may_be_part {
        true => rendered_area(&mut source, &mut row)?,
        false => None,
    };
    let mut found = Findings {
        zero_is_unknown: input.roles.zero_is_unknown || pixels.zeros_are_noisy() || halves_are_one,
        halves_are_one,
        wrap: wraps(input, wrap, area, &seam),
        area,
        warnings: Vec::new(),
        notes: Vec::new(),
        problem: None,
    };
    found.say(input, &pixels, halves.as_ref());
    Ok(found)
}

impl Findings {
    fn say(&mut self, input: &Input, pixels: &PixelsLook, halves: Option<&HalvesLook>) {
        if let Some(halves) = halves {
            self.say_of_halves(input, halves);
        } else if pixels.zeros_are_noisy() {
            let names = variance_names(input);
            self.warnings.push(format!(
                "{names}: 0 at {:.0} % of the pixels looked at, where the picture has noise: what is 0 there is taken for unknown, and estimated from the picture",
                100.0 * pixels.share_of_zeros()
            ));
        }
        if let Some(share) = pixels.correlation() {
            self.warnings.push(format!(
                "neighbouring pixels share samples (their noise differs by {:.0} % of what the stated variances say): a pixel filter wider than a pixel blurs the noise, which is then denoised less well; render with a box filter of one pixel",
                100.0 * share
            ));
        }
        if let Some(area) = self.area {
            self.notes.push(format!(
                "only {} x {} pixels at ({}, {}) hold anything: denoised like a picture of their own",
                area.size.width(),
                area.size.height(),
                area.x,
                area.y
            ));
        }
        if self.wrap {
            self.notes.push(
                "the left and right ends of the picture meet: windows wrap around them".into(),
            );
        }
    }

    fn say_of_halves(&mut self, input: &Input, halves: &HalvesLook) {
        if halves.are_one() {
            self.warnings.push(
                "the two halves are the same picture (the same seed?), so their difference says nothing of the noise: it is estimated from the picture; render the halves with different seeds"
                    .into(),
            );
        } else if halves.differ() {
            let problem =
                "the two halves are not of the same picture: they differ by more than noise";
            let other = input.names.files().get(1);
            self.problem = Some(match other {
                Some(file) => Error::Setting {
                    setting: Setting::OtherHalf,
                    value: file.path().display().to_string(),
                    problem: problem.into(),
                },
                None => Error::Invalid(format!("{}: {problem}", input.path().display())),
            });
        } else if halves.seem_to_differ() {
            self.warnings.push(
                "the two halves differ by more than noise: are they of the same frame, and the same camera?".into(),
            );
        } else if let Some(ratio) = halves.noise_ratio() {
            self.warnings.push(format!(
                "the noise of one half is {ratio:.1} times as strong as that of the other (another number of samples?): their average weighs both alike, and is noisier than it could be"
            ));
        }
    }
}

/// Whether the windows of a picture are to wrap around.
fn wraps(input: &Input, wrap: Wrap, area: Option<Area>, seam: &Seam) -> bool {
    match wrap {
        Wrap::X => true,
        Wrap::Never => false,
        Wrap::Auto if area.is_some() => false,
        Wrap::Auto => {
            let part = &input.file().parts()[input.roles.colour[0].part];
            let latitude_longitude = part.attributes.value("envmap", "envmap") == Some(&[0]);
            let size = part.header.layer_size;
            latitude_longitude || (size.0 == 2 * size.1 && seam.is_closed())
        }
    }
}

/// The channels of a given variance.
fn variance_names(input: &Input) -> String {
    let mut names: Vec<String> = match &input.roles.variance {
        Variance::Given { channels, .. } => {
            channels.iter().map(|at| input.names.name(*at)).collect()
        }
        _ => Vec::new(),
    };
    names.dedup();
    names.join(" ")
}

/// The rows that are looked at: all of a small image, else strips that begin where chunks do.
pub(super) fn strips(input: &Input, height: usize) -> Vec<Range<usize>> {
    let at = input.roles.colour[0];
    let grid = &input.names.files()[at.file].parts()[at.part].grid;
    let chunk = grid.chunk_height().max(1);
    if height <= ALL_ROWS {
        return (0..height)
            .step_by(STRIP)
            .map(|first| first..height.min(first + STRIP))
            .collect();
    }
    let mut strips: Vec<Range<usize>> = Vec::new();
    for k in 0..STRIPS {
        // in the middle of a fifth of the image each
        let wanted = (2 * k + 1) * height / (2 * STRIPS);
        let first = wanted / chunk * chunk;
        let strip = first..height.min(first + STRIP);
        if strips.last().is_none_or(|last| last.end <= strip.start) {
            strips.push(strip);
        }
    }
    strips
}
