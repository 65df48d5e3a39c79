//! `linpred compare`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use crate::exr_file::output::check_output;
use crate::job::{CompareRequest, Comparing, Comparison, DEFAULT_MEMORY_LIMIT, Figures};
use crate::{Error, ImageSize};

use super::args::CompareArguments;
use super::errors::DONE;
use super::heatmap::Heatmap;
use super::picture::Picture;
use super::png_rows;
use super::{stdout, stop, threads};

/// Prints the figures of a comparison, and draws what is asked for.
pub(crate) fn run(arguments: CompareArguments) -> Result<u8, Error> {
    let limit = arguments.max_memory.unwrap_or(DEFAULT_MEMORY_LIMIT);
    let request = CompareRequest::new(arguments.image, arguments.reference)
        .with_input(arguments.input)
        .with_map(arguments.map)
        .with_memory_limit(limit)
        .with_threads(threads::to_use(arguments.threads));
    let pictures = Pictures {
        heatmap: arguments.heatmap,
        picture: arguments.picture,
    };
    let comparison = compare(&request, &pictures, &stop::on_signals())?;
    let text = match arguments.json {
        true => format!("{}\n", serde_json::json!(comparison)),
        false => in_words(&comparison),
    };
    stdout::print(&text)?;
    Ok(DONE)
}

/// Compares images as the command does, and draws the pictures that are asked for.
///
/// The errors of [`Comparing`], and [`Error::Write`] if a picture cannot be written.
pub fn compare(
    request: &CompareRequest,
    pictures: &Pictures,
    stop: &AtomicBool,
) -> Result<Comparison, Error> {
    pictures.check(request)?;
    let mut images = Comparing::open(request)?;
    let (size, has_input) = (images.size(), request.input.is_some());
    images.reserve("pictures", pictures.bytes(size, has_input));
    images.plan().check(request.memory_limit)?;
    let drawn = pictures.create(size, has_input)?;
    measure(&mut images, drawn, stop)
}

/// Where pictures of a comparison go, PNG files.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    /// One of the relative error.
    pub heatmap: Option<PathBuf>,
    /// One to look at: the images side by side, and the worst places.
    pub picture: Option<PathBuf>,
}

impl Pictures {
    fn check(&self, request: &CompareRequest) -> Result<(), Error> {
        let mut read: Vec<&Path> = vec![&request.image, &request.reference];
        read.extend(request.input.as_deref());
        for path in self.heatmap.iter().chain(&self.picture) {
            check_output(path, &read)?;
        }
        match (&self.heatmap, &self.picture) {
            (Some(heatmap), Some(picture)) if heatmap == picture => Err(Error::Usage(format!(
                "the heat map and the picture cannot both be {}",
                picture.display()
            ))),
            _ => Ok(()),
        }
    }

    fn bytes(&self, size: ImageSize, has_input: bool) -> u64 {
        let heatmap = self.heatmap.iter().map(|_| png_rows::bytes(size.width()));
        let picture = self.picture.iter();
        let picture = picture.map(|_| Picture::bytes(size, has_input));
        heatmap.chain(picture).fold(0, u64::saturating_add)
    }

    fn create(&self, size: ImageSize, has_input: bool) -> Result<Drawn, Error> {
        let heatmap = self.heatmap.as_deref();
        let picture = self.picture.as_deref();
        Ok(Drawn {
            heatmap: heatmap
                .map(|path| Heatmap::create(path, size))
                .transpose()?,
            picture: picture
                .map(|path| Picture::create(path, size, has_input))
                .transpose()?,
        })
    }
}

/// The pictures that are being drawn.
struct Drawn {
    heatmap: Option<Heatmap>,
    picture: Option<Picture>,
}

fn measure(
    images: &mut Comparing,
    mut drawn: Drawn,
    stop: &AtomicBool,
) -> Result<Comparison, Error> {
    let comparison = images.measure(stop, |row, errors| {
        if let Some(heatmap) = &mut drawn.heatmap {
            heatmap.row(errors)?;
        }
        if let Some(picture) = &mut drawn.picture {
            picture.row(row, errors)?;
        }
        Ok(())
    })?;
    if let Some(picture) = drawn.picture {
        picture.finish(images, &comparison.worst_places, stop)?;
    }
    if let Some(heatmap) = drawn.heatmap {
        heatmap.finish()?;
    }
    Ok(comparison)
}

/// A line of the table: its name, the figure, its decimals, what to know of it.
type Line = (&'static str, fn(&Figures) -> f64, usize, &'static str);

const LINES: [Line; 12] = [
    ("rMSE", |f| f.rmse, 6, ""),
    ("MSE", |f| f.mse, 6, ""),
    ("PSNR", |f| f.psnr, 2, "dB, tone-mapped"),
    ("FLIP", |f| f.flip, 4, "0: looks the same"),
    ("mean", |f| f.mean, 6, "radiance"),
    ("energy", |f| f.energy, 4, "1: no light is lost"),
    ("bias", |f| f.bias, 4, "0: nor locally"),
    ("off5", |f| 100.0 * f.off5, 2, "% of the pixels"),
    ("top1", |f| f.top1, 4, "1: highlights stay"),
    ("pinholes", |f| f.pinholes, 1, "per megapixel"),
    ("sparks", |f| f.sparks, 1, "per megapixel"),
    ("not finite", |f| f.non_finite as f64, 0, "samples"),
];

fn in_words(comparison: &Comparison) -> String {
    let input = comparison.input.as_ref();
    let cell = |figure: Option<f64>, decimals| match figure {
        None => String::new(),
        Some(figure) => format!("{figure:>14.decimals$}"),
    };
    let heading = input.map_or(String::new(), |_| format!("{:>14}", "input"));
    let mut text = format!("{:<10}{:>14}{heading}\n", "", "image");
    for (name, figure, decimals, note) in LINES {
        let image = cell(Some(figure(&comparison.figures)), decimals);
        let input = cell(input.map(figure), decimals);
        let line = format!("{name:<10}{image}{input}  {note}");
        text += &format!("{}\n", line.trim_end());
    }
    if let Some(gain) = comparison.gain {
        text += &format!("{:<10}{gain:>14.2}\n", "gain");
    }
    let mean = comparison.reference_mean;
    let own = match comparison.reference_has_variance {
        true => "taken off the relative errors",
        false => "not known",
    };
    text + &format!(
        "the reference's mean radiance: {mean:.6}\nthe reference's own noise: {own}\n{}",
        worst_in_words(comparison)
    )
}

fn worst_in_words(comparison: &Comparison) -> String {
    let line = |x: usize, y: usize, error: f64| format!("  x {x:>5}  y {y:>5}  {error:.4}\n");
    let mut text = String::from("worst pixels, relative squared error\n");
    for pixel in &comparison.worst {
        text += &line(pixel.x, pixel.y, pixel.error);
    }
    text += "worst places of 32 x 32 pixels, mean of it\n";
    for place in &comparison.worst_places {
        text += &line(place.x, place.y, place.error);
    }
    text
}
