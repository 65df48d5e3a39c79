//! What the header of an output says of how it was made, and of what.

use crate::channels::names::ChannelRef;
use crate::channels::presets::Role;
use crate::channels::roles::FurtherChannels;
use crate::channels::variance::Variance;
use crate::error::Error;
use crate::exr_file::attributes::{
    INPUT_ATTRIBUTE, NEIGHBOURS_ATTRIBUTE, NOISE_ATTRIBUTE, OPTIONS_ATTRIBUTE, VERSION_ATTRIBUTE,
};
use crate::job::input::{Input, Neighbours};
use crate::job::options::JobOptions;

/// The attributes of the output, by their names: version, options, checksums of what it is made of.
pub(super) fn marks(
    pictures: &[Input],
    options: &JobOptions,
) -> Result<Vec<(&'static str, String)>, Error> {
    let Some(first) = pictures.first() else {
        return Ok(Vec::new());
    };
    let params = &options.pipeline.params;
    let roles = pictures.iter().flat_map(|picture| {
        let assigned = picture.roles.assignments.iter();
        // what a frame alone does not read has no part in its output
        let is_helped = picture.helpers().next().is_some();
        let read = assigned.filter(move |a| is_helped || !a.role.is_of_motion());
        read.map(|a| {
            let names: Vec<String> = a
                .channels
                .iter()
                .map(|at| picture.names.name(*at))
                .collect();
            format!("{}={}", a.role.name(), names.join(","))
        })
    });
    let roles: Vec<String> = roles.collect();
    let further = pictures.iter().flat_map(|picture| {
        let further = picture.roles.further.iter();
        further.map(|feature| further_feature(picture, feature))
    });
    let further: Vec<String> = further.collect();
    let further = match further.is_empty() {
        true => String::new(),
        false => format!("features {}; ", further.join(" ")),
    };
    let layers = pictures.iter().flat_map(|picture| &picture.layers);
    let layers: Vec<&str> = layers.map(|layer| layer.name.as_str()).collect();
    let samples = pictures
        .iter()
        .map(|picture| picture.roles.samples.as_ref());
    let samples: Vec<String> = samples.flatten().map(ToString::to_string).collect();
    let wraps: Vec<String> = pictures
        .iter()
        .map(|picture| picture.wrap.to_string())
        .collect();
    let text = format!(
        "formulas {:?}; coverage {}; vary features {}; {}; {further}layers {}; samples {}; wraps {}",
        params.formulas,
        params.coverage,
        params.vary_features,
        roles.join("; "),
        layers.join(","),
        samples.join(","),
        wraps.join(","),
    );
    let noise = pictures.iter().flat_map(|picture| {
        let roles = [Role::Variance, Role::HalfA, Role::HalfB];
        let channels = roles
            .into_iter()
            .filter_map(|role| picture.roles.assignment(role));
        let channels = channels.flat_map(|assignment| &assignment.channels);
        channels.map(|at| picture.names.name(*at))
    });
    let noise: Vec<String> = noise.collect();
    let mut marks = vec![
        (VERSION_ATTRIBUTE, env!("CARGO_PKG_VERSION").to_owned()),
        (OPTIONS_ATTRIBUTE, text),
        (INPUT_ATTRIBUTE, first.fingerprints()?),
    ];
    if !noise.is_empty() {
        marks.push((NOISE_ATTRIBUTE, noise.join(", ")));
    }
    if let Some(neighbours) = &first.neighbours {
        marks.push((NEIGHBOURS_ATTRIBUTE, mark_of(neighbours)?));
    }
    Ok(marks)
}

/// What the header says of the frames that helped.
fn mark_of(neighbours: &Neighbours) -> Result<String, Error> {
    let side = |frames: &[Input], which: &str| {
        let checksums: Result<Vec<String>, Error> =
            frames.iter().map(Input::fingerprints).collect();
        let mut words = format!("{} {which}", frames.len());
        for (n, checksum) in checksums?.iter().enumerate() {
            words += &format!("{} {checksum}", if n == 0 { ":" } else { "," });
        }
        Ok(words)
    };
    let (before, after) = (
        side(&neighbours.before, "before")?,
        side(&neighbours.after, "after")?,
    );
    Ok(format!("{before}; {after}"))
}

/// A further feature's channels and those of its noise, in quotes, so that no two are told alike.
fn further_feature(picture: &Input, feature: &FurtherChannels) -> String {
    let names = |channels: &[ChannelRef]| -> Vec<String> {
        channels.iter().map(|at| picture.names.name(*at)).collect()
    };
    let noise = match &feature.variance {
        Variance::Given { meaning, .. } => format!("{meaning:?}"),
        Variance::Halves { .. } | Variance::OtherFile(_) => "halves".into(),
        Variance::None => "estimated".into(),
    };
    let of_noise = names(&feature.variance.channels());
    format!("{:?} {noise} {of_noise:?}", names(&feature.channels))
}
