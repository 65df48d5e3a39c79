//! The file that passes are merged into: the parts and attributes of the first pass, true of all of them.

use std::path::Path;

use exr::meta::attribute::SampleType;

use crate::channels::samples;
use crate::error::Error;
use crate::exr_file::Part;
use crate::exr_file::attributes::{Attributes, MERGED_ATTRIBUTE};
use crate::image::new_image::{NewImage, NewPart};
use crate::job::merge::channels::{Channel, Kind};
use crate::job::merge::pass::Pass;

/// A part of the output.
struct Plan<'a> {
    like: &'a Part,
    /// Its name, if it is not that of the part it is like.
    name: Option<&'a str>,
    /// Which of the list of channels it holds.
    channels: Vec<usize>,
}

/// The output in the making.
#[derive(Debug)]
pub(super) struct Output {
    image: NewImage,
    /// The channels of each part.
    parts: Vec<Vec<usize>>,
}

impl Output {
    /// Begins the output of these passes, each of which has `asked` samples per pixel, if that was said. Errors as for [`NewImage::of_parts`].
    pub(super) fn create(path: &Path, passes: &[Pass], asked: Option<u32>) -> Result<Self, Error> {
        let list = &passes[0].channels.list;
        let made_of: Vec<&str> = (passes.iter().flat_map(|pass| &pass.made_of))
            .map(String::as_str)
            .collect();
        let marks = [(MERGED_ATTRIBUTE, made_of.join(" "))];
        let (mut parts, mut channels) = (Vec::new(), Vec::new());
        for plan in plans(&passes[0]) {
            let mut part = NewPart::like(plan.like, &named(list, &plan.channels), &marks)?;
            let attributes = part.attributes_mut();
            if let Some(name) = plan.name {
                attributes.set("name", "string", name.as_bytes().to_vec());
            }
            restate_counts(attributes, plan.like, passes, asked);
            parts.push(part);
            channels.push(plan.channels);
        }
        Ok(Self {
            image: NewImage::of_parts(path, parts)?,
            parts: channels,
        })
    }

    /// Takes the next row: a plane for each channel of the list.
    pub(super) fn write_row(&mut self, planes: &[Vec<f32>]) -> Result<(), Error> {
        for (part, channels) in self.parts.iter().enumerate() {
            let own: Vec<&[f32]> = channels.iter().map(|&c| &planes[c][..]).collect();
            self.image.write_part_row(part, &own)?;
        }
        Ok(())
    }

    /// Completes the file and gives it its name.
    pub(super) fn finish(self) -> Result<(), Error> {
        self.image.finish()
    }
}

/// Bytes of memory that writing the output takes, beside its rows.
pub(super) fn bytes(first: &Pass) -> u64 {
    let list = &first.channels.list;
    let parts = plans(first).into_iter();
    let bytes = parts.map(|plan| NewImage::bytes(plan.like, &named(list, &plan.channels)));
    bytes.fold(0, u64::saturating_add)
}

/// The parts of the output: those of the first pass of which something is left, and those of numbers of samples.
fn plans(first: &Pass) -> Vec<Plan<'_>> {
    let list = &first.channels.list;
    let of = |part: usize, own: Option<&str>| -> Vec<usize> {
        let inside =
            |channel: &Channel| channel.at.part == part && channel.own_part.as_deref() == own;
        let positions = 0..list.len();
        positions
            .filter(|&position| inside(&list[position]))
            .collect()
    };
    let parts = first.file().parts();
    let mut plans: Vec<Plan<'_>> = Vec::new();
    for like in parts {
        let counts = list.iter().filter(|channel| channel.at.part == like.index);
        let counts = counts.filter_map(|channel| channel.own_part.as_deref());
        for name in std::iter::once(None).chain(counts.map(Some)) {
            let channels = of(like.index, name);
            if !channels.is_empty() {
                plans.push(Plan {
                    like,
                    name,
                    channels,
                });
            }
        }
    }
    plans
}

/// Names and types of some of the channels.
fn named(list: &[Channel], channels: &[usize]) -> Vec<(String, SampleType)> {
    let channel = |&position: &usize| {
        let channel = &list[position];
        let kind = match channel.kind {
            Kind::Identifier { integer: true } => SampleType::U32,
            _ => SampleType::F32,
        };
        (channel.name.clone(), kind)
    };
    channels.iter().map(channel).collect()
}

/// States again what the part says of its samples per pixel: those of all passes together, if each of them says so; `asked` is what each has whatever it says.
fn restate_counts(attributes: &mut Attributes, like: &Part, passes: &[Pass], asked: Option<u32>) {
    for attribute in like.attributes.iter() {
        let name = String::from_utf8_lossy(&attribute.name);
        if !samples::is_attribute(&name) {
            continue;
        }
        let count = |pass: &Pass| {
            let mut parts = pass.file().parts().iter();
            let stated = || parts.find_map(|part| samples::stated(&part.attributes, &name));
            asked.or_else(stated)
        };
        let sum = passes
            .iter()
            .try_fold(0, |sum: u32, pass| sum.checked_add(count(pass)?));
        if let Some(sum) = sum {
            samples::state(attributes, attribute, sum);
        }
    }
}
