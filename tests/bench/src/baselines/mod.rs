//! Simple filters to compare with, on whole images in memory.

mod guided;
mod joint_bilateral;
mod nonlocal_means;
mod planes;

use anyhow::{Result, bail};

use crate::clock::measure;
use crate::image::{Colour, Image};
use crate::method::Method;
use crate::point::Done;
use planes::{Planes, box_mean};

/// Denoises `copies` x `copies` of an image by one of the simple methods.
pub(crate) fn denoise(image: &Image, copies: usize, method: Method) -> Result<Done> {
    let planes = Planes::mirrored(image, copies)?;
    let filter: fn(&Planes) -> [Vec<f32>; 3] = match method {
        Method::Noisy => |planes| planes.colour.clone(),
        Method::Box => |planes| {
            planes
                .colour
                .each_ref()
                .map(|c| box_mean(c, planes.width, 2))
        },
        Method::Bilateral => joint_bilateral::filter,
        Method::Guided => guided::filter,
        Method::Nlm => nonlocal_means::filter,
        _ => bail!("{} is no simple filter", method.name()),
    };
    let (planes, cost) = measure(|| filter(&planes));
    Ok(Done {
        colour: Some(Colour { planes }),
        cost,
        report: None,
    })
}
