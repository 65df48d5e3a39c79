//! A frame of a sequence is opened together with the frames beside it that can help it.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use same_file::Handle;

use crate::channels::presets::Role;
use crate::channels::roles::in_words;
use crate::channels::variance::Variance;
use crate::error::Error;
use crate::job::input::{Input, Neighbours, Unused};
use crate::job::look::strips;
use crate::job::memory::DEFAULT_MEMORY_LIMIT;
use crate::job::request::InputRequest;
use crate::row::{InputRow, Motion, RowLayout, RowSource};
use linpred_core::Feature;

/// Frames on each side that help where nothing else is said.
pub const DEFAULT_REACH: NonZeroUsize = NonZeroUsize::new(3).unwrap();

/// Frames on each side that may help: of more a pixel sees little that it does not see of these, and each takes memory and time.
pub const MOST_REACH: NonZeroUsize = NonZeroUsize::new(8).unwrap();

/// The files of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameFiles {
    /// The noisy image.
    pub path: PathBuf,
    /// The image from the other half of the samples, if the noisy image is from one half.
    pub other_half: Option<PathBuf>,
}

/// The files of the frames beside one, on each side nearest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeighbourFiles {
    /// Those before it.
    pub before: Vec<FrameFiles>,
    /// Those after it.
    pub after: Vec<FrameFiles>,
}

/// Opens the pictures of a frame, as [`Input::open_all`] does, and in the same way those of the frames beside it. One of them that cannot be opened, or whose
/// pictures are not alike, does not help, nor do those beyond it, through which nothing can be followed: [`Neighbours::unused`] says why.
///
/// [`Error::Usage`] if a file is given twice, or is the frame's own, or there are more than [`MOST_REACH`] on a side; and the errors of [`Input::open_all`] about the frame itself.
pub fn open_frame(request: &InputRequest, files: &NeighbourFiles) -> Result<Vec<Input>, Error> {
    check_count("before", &files.before)?;
    check_count("after", &files.after)?;
    check_distinct(&request.path, files)?;
    let mut pictures = Input::open_all(request)?;
    let limit = request.memory_limit.unwrap_or(DEFAULT_MEMORY_LIMIT);
    let forget = |picture: &mut Input| forget_silent_vectors(picture, limit);
    pictures.iter_mut().try_for_each(forget)?;
    let mut unused = Vec::new();
    let before = open_side(&pictures, request, &files.before, &mut unused);
    let after = open_side(&pictures, request, &files.after, &mut unused);
    let of_picture = |side: &[Vec<Input>], n: usize| side.iter().map(|p| p[n].clone()).collect();
    for (n, picture) in pictures.iter_mut().enumerate() {
        if !(before.is_empty() && after.is_empty()) && picture.motion() == Motion::default() {
            picture.roles.notes.push(
                "neither motion vectors nor positions: the frames beside it help where nothing moves".into(),
            );
        }
        picture.neighbours = Some(Neighbours {
            before: of_picture(&before, n),
            after: of_picture(&after, n),
            unused: unused.clone(),
        });
    }
    Ok(pictures)
}

fn check_count(side: &str, files: &[FrameFiles]) -> Result<(), Error> {
    match files.len() <= MOST_REACH.get() {
        true => Ok(()),
        false => Err(Error::Usage(format!(
            "{} frames {side} are given: at most {MOST_REACH} may help",
            files.len()
        ))),
    }
}

/// Refuses a frame that would help twice, or itself: its noise would count as a second sample of it.
fn check_distinct(own: &Path, files: &NeighbourFiles) -> Result<(), Error> {
    let mut known: Vec<(Handle, &Path)> = Vec::new();
    let beside = files.before.iter().chain(&files.after);
    for path in std::iter::once(own).chain(beside.map(|files| files.path.as_path())) {
        // what cannot be opened is told where it is needed
        let Ok(handle) = Handle::from_path(path) else {
            continue;
        };
        if let Some((_, twin)) = known.iter().find(|(known, _)| *known == handle) {
            return Err(Error::Usage(format!(
                "{} and {} are one file: a frame can help another once, and not itself",
                twin.display(),
                path.display()
            )));
        }
        known.push((handle, path));
    }
    Ok(())
}

/// The pictures of the frames on one side, as far as nothing is wrong with them.
fn open_side(
    pictures: &[Input],
    request: &InputRequest,
    files: &[FrameFiles],
    unused: &mut Vec<Unused>,
) -> Vec<Vec<Input>> {
    let mut opened = Vec::new();
    for frame in files {
        match open(pictures, request, frame) {
            Ok(alike) => opened.push(alike),
            Err(why) => {
                unused.push(Unused {
                    path: frame.path.clone(),
                    why,
                });
                break;
            }
        }
    }
    opened
}

/// The pictures of a frame beside that of `pictures`, or why they are of no use.
fn open(
    pictures: &[Input],
    request: &InputRequest,
    frame: &FrameFiles,
) -> Result<Vec<Input>, String> {
    if !frame.path.exists() {
        return Err("it does not exist".into());
    }
    let request = InputRequest {
        path: frame.path.clone(),
        other_half: frame.other_half.clone(),
        ..request.clone()
    };
    let mut others =
        Input::open_all(&request).map_err(|error| format!("{error}{}", error.causes()))?;
    let labels =
        |pictures: &[Input]| -> Vec<String> { pictures.iter().map(|p| p.roles.label()).collect() };
    if labels(pictures) != labels(&others) {
        return Err("it has other pictures (views, view layers)".into());
    }
    let limit = request.memory_limit.unwrap_or(DEFAULT_MEMORY_LIMIT);
    others
        .iter_mut()
        .try_for_each(|picture| forget_silent_vectors(picture, limit))
        .map_err(|error| format!("{error}{}", error.causes()))?;
    // bands of one frame agree on what helps them, whichever rows they read
    for file in others.iter().flat_map(|picture| picture.names.files()) {
        let complete = file.check_complete();
        complete.map_err(|error| format!("{error}{}", error.causes()))?;
    }
    if pictures.iter().zip(&others).all(nothing_tells) {
        return Err("neither motion, positions nor variances tell what moves from what is noise: each frame is denoised alone".into());
    }
    for (own, other) in pictures.iter().zip(&mut others) {
        // pixels are followed from one to the other: both are read where the frame itself is
        other.area = own.area;
        other.neighbours = Some(Neighbours::default());
        check_alike(own, other)?;
        // what is no light is not averaged over frames, and not read
        other.layers.retain(|layer| layer.is_light);
    }
    Ok(others)
}

/// Whether nothing of two frames says what moves, and nothing how noisy they are: their differences may be either.
fn nothing_tells((own, other): (&Input, &Input)) -> bool {
    let still = [own, other].map(|input| input.motion() == Motion::default());
    still == [true, true] && matches!(own.roles.variance, Variance::None)
}

/// Takes motion vectors from a picture that are all 0, as Cycles writes them where motion blur is on: they would say that what moves stands still.
fn forget_silent_vectors(picture: &mut Input, limit: u64) -> Result<(), Error> {
    let motion = picture.motion();
    if !(motion.backward || motion.forward) || vectors_tell(picture, limit)? {
        return Ok(());
    }
    let vectors = [Role::Motion, Role::MotionForward];
    let assignments = &mut picture.roles.assignments;
    assignments.retain(|assignment| !vectors.contains(&assignment.role));
    picture.roles.notes.push(
        "motion vectors are all 0, as where nothing moves, and as Cycles writes them where motion blur is on: not used".into(),
    );
    Ok(())
}

/// Whether one of the vectors in the rows that are looked at is not 0.
fn vectors_tell(picture: &Input, limit: u64) -> Result<bool, Error> {
    let mut source = picture.source_in_sequence(limit)?;
    let mut row = InputRow::new(&source.layout());
    for y in strips(picture, picture.area.size.height())
        .into_iter()
        .flatten()
    {
        source.read_row(y, &mut row)?;
        let vectors = row.backward.iter().chain(&row.forward);
        if vectors.flatten().any(|value| value.abs() > 0.0) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Whether a picture of another frame can help: says what stands in the way.
fn check_alike(own: &Input, other: &Input) -> Result<(), String> {
    let windows = |input: &Input| {
        let at = input.roles.colour[0];
        let header = &input.names.files()[at.file].parts()[at.part].header;
        let display = header.shared_attributes.display_window;
        [("data", header.data_window()), ("display", display)]
    };
    for ((name, own), (_, other)) in windows(own).into_iter().zip(windows(other)) {
        if own != other {
            return Err(format!(
                "its {name} window is {}, not {}",
                in_words(other),
                in_words(own)
            ));
        }
    }
    let names = |input: &Input| -> Vec<String> {
        input
            .layers
            .iter()
            .map(|layer| layer.name.clone())
            .collect()
    };
    if names(own) != names(other) {
        return Err(format!(
            "its layers are {}, not {}",
            names(other).join(" "),
            names(own).join(" ")
        ));
    }
    match difference(&own.layout_in_sequence(), &other.layout_in_sequence()) {
        Some(what) => Err(format!("it has {what}")),
        None => Ok(()),
    }
}

/// What rows of another layout have that a frame's lack, or the other way round. What they say of motion may differ: things begin to move.
fn difference(own: &RowLayout, other: &RowLayout) -> Option<String> {
    let differs = |own: bool, other: bool, what: &str| {
        let article = if other { "a" } else { "no" };
        (own != other).then(|| format!("{article} {what}"))
    };
    let features = Feature::ALL.into_iter().find_map(|feature| {
        let (at, name) = (feature.range().start, feature.name());
        let variances = (own.feature_variances[at], other.feature_variances[at]);
        differs(own.features[at], other.features[at], name)
            .or_else(|| differs(variances.0, variances.1, &format!("variance of the {name}")))
    });
    let further = || (own.further != other.further).then(|| "other features".to_owned());
    features
        .or_else(further)
        .or_else(|| differs(own.alpha, other.alpha, "channel of alpha"))
        .or_else(|| (own.variance != other.variance).then(|| "another kind of variance".into()))
        .or_else(|| (own != &other.with_motion(own.motion)).then(|| "other layers".into()))
}
