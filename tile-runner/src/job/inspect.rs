//! What a file holds and what would be done with it.

use std::fmt;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred_core::Feature;

use crate::channels::names::ChannelRef;
use crate::channels::presets::Role;
use crate::channels::roles::Roles;
use crate::channels::variance::Variance;
use crate::error::Error;
use crate::exr_file::{ExrFile, Part};
use crate::image::rewrite::OutputOptions;
use crate::job::input::{Input, rewrite};
use crate::job::memory::{self, DEFAULT_MEMORY_LIMIT};
use crate::job::plan;
use crate::job::request::InputRequest;
use crate::stream::survey::{self, Survey};

/// A part in words.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PartInfo {
    /// Number and name.
    pub label: String,
    /// Columns of its data window.
    pub width: usize,
    /// Rows of its data window.
    pub height: usize,
    /// Top left corner of the data window.
    pub origin: [i32; 2],
    /// Compression, by OpenEXR's name for it.
    pub compression: String,
    /// Scanline chunks or tiles, and their size.
    pub chunks: String,
    /// Names and sample types of the channels.
    pub channels: Vec<String>,
    /// Why its pixels cannot be decoded, if they cannot.
    pub refusal: Option<String>,
    /// Whether `denoise` would copy it as it is.
    pub passed_through: bool,
}

/// A role in words.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct RoleInfo {
    /// The role's name.
    pub role: String,
    /// Names of its channels.
    pub channels: Vec<String>,
    /// Why these.
    pub rule: String,
}

/// All that `inspect` says.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Inspection {
    /// The file.
    pub path: String,
    /// Its parts.
    pub parts: Vec<PartInfo>,
    /// Its roles, as far as they could be assigned.
    pub roles: Vec<RoleInfo>,
    /// Samples per pixel and who says so.
    pub samples: Option<String>,
    /// Where the variance comes from.
    pub variance: Option<String>,
    /// How what it shows would be found in the frames beside it.
    pub motion: Option<String>,
    /// Features that are missing.
    pub missing: Vec<String>,
    /// Layers that could be features, too, by what the renderer is known to write, and are not asked for.
    pub offered: Vec<String>,
    /// Channels that play no role and stay as they are.
    pub untouched: Vec<String>,
    /// What was left aside, and why.
    pub notes: Vec<String>,
    /// What stands in the way of a better result.
    pub warnings: Vec<String>,
    /// The channels that the denoised colour goes into, where they are not the colour's own.
    pub written_to: Vec<String>,
    /// Which of the file's pictures this is: a view, a view layer; empty in a file with one.
    pub picture: String,
    /// The other pictures of the file, which are denoised in the same run.
    pub others: Vec<Inspection>,
    /// What the pixels hold, if they were surveyed.
    pub pixels: Option<Survey>,
    /// Why `denoise` would refuse the file, if it would.
    pub problem: Option<String>,
}

/// Inspects a file. A file that can be opened but not denoised is no error: the reason comes beside its description, and as
/// its [`problem`](Inspection::problem).
pub fn inspect(request: &InputRequest) -> Result<(Inspection, Option<Error>), Error> {
    inspect_with(request, |_| Ok(None))
}

/// The same; if the file can be denoised, the pixels of each of its pictures are what `survey` finds in them. An error of that is a problem of the file, but for
/// one of memory.
pub fn inspect_with(
    request: &InputRequest,
    mut survey: impl FnMut(&Input) -> Result<Option<Survey>, Error>,
) -> Result<(Inspection, Option<Error>), Error> {
    let (mut inspection, problem) = match Input::open_all(request) {
        Ok(pictures) => {
            let mut inspection = describe(&pictures);
            let mut problem = obstacle(&pictures);
            for (n, picture) in pictures.iter().enumerate() {
                if problem.is_some() {
                    break;
                }
                match survey(picture) {
                    Ok(pixels) if n == 0 => inspection.pixels = pixels,
                    Ok(pixels) => inspection.others[n - 1].pixels = pixels,
                    // says nothing of the file
                    Err(error @ (Error::Budget(_) | Error::OverLimit { .. })) => return Err(error),
                    Err(error) => problem = Some(error),
                }
            }
            (inspection, problem)
        }
        Err(error @ (Error::Usage(_) | Error::Setting { .. })) => return Err(error),
        Err(error) => (bare(&ExrFile::open(&request.path)?), Some(error)),
    };
    inspection.problem = problem.as_ref().map(ToString::to_string);
    Ok((inspection, problem))
}

/// Surveys an input within `limit` bytes of memory, on fewer than `threads` threads where that takes less. `progress` is told how many rows are
/// done; when it breaks, the survey ends with [`Error::Cancelled`]. [`Error::OverLimit`] or [`Error::Budget`] if the memory does not suffice.
pub fn survey(
    input: &Input,
    threads: NonZeroUsize,
    limit: u64,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Survey, Error> {
    let (threads, plan) = plan::survey_plan(input, threads, limit);
    plan.check(limit)?;
    memory::check_available(&plan, threads.get())?;
    let mut source = input.source(limit)?;
    let mut found = survey::survey(&mut source, threads, progress)?;
    let further = input.roles.further.iter().flat_map(|own| &own.channels);
    for (n, at) in further.enumerate() {
        let names = found.constant_features.iter_mut();
        for name in names.filter(|name| **name == survey::further_name(n)) {
            *name = input.names.name(*at);
        }
    }
    Ok(found)
}

/// Why pictures whose roles are known cannot be denoised, if they cannot.
fn obstacle(pictures: &[Input]) -> Option<Error> {
    let refused = rewrite(pictures, OutputOptions::default(), &[]).err();
    let mut sources = pictures
        .iter()
        .map(|input| input.source(DEFAULT_MEMORY_LIMIT));
    refused.or_else(|| sources.find_map(Result::err))
}

/// The description of a file without roles.
fn bare(file: &ExrFile) -> Inspection {
    Inspection {
        path: file.path().display().to_string(),
        parts: file
            .parts()
            .iter()
            .map(|part| part_info(part, true))
            .collect(),
        ..Inspection::default()
    }
}

/// Describes the pictures of a file whose roles are known.
pub fn describe(pictures: &[Input]) -> Inspection {
    let Some((first, others)) = pictures.split_first() else {
        return Inspection::default();
    };
    let rewrite = rewrite(pictures, OutputOptions::default(), &[]);
    let rewritten = |part: &Part| {
        rewrite
            .as_ref()
            .is_ok_and(|output| output.rewritten.iter().any(|r| r.index == part.index))
    };
    let mut inspection = Inspection {
        path: first.file().path().display().to_string(),
        parts: (first.file().parts().iter())
            .map(|part| part_info(part, !rewritten(part)))
            .collect(),
        untouched: untouched(pictures),
        others: others.iter().map(describe_picture).collect(),
        ..describe_picture(first)
    };
    if let Ok(output) = &rewrite {
        inspection.notes.extend(output.notes.iter().cloned());
    }
    inspection
}

/// What is told of each picture.
fn describe_picture(input: &Input) -> Inspection {
    let roles = &input.roles;
    let target = (roles.target != roles.colour).then_some(roles.target);
    Inspection {
        roles: role_infos(input),
        samples: roles.samples.as_ref().map(ToString::to_string),
        variance: Some(variance_in_words(roles)),
        motion: Some(motion_in_words(input)),
        missing: Feature::ALL
            .into_iter()
            .filter(|feature| roles.feature(*feature).is_none())
            .map(|feature| feature.name().to_owned())
            .collect(),
        offered: (roles.offered.iter())
            .filter(|name| roles.further.iter().all(|own| own.name != **name))
            .cloned()
            .collect(),
        notes: roles.notes.clone(),
        warnings: roles.warnings.clone(),
        written_to: (target.iter().flatten())
            .chain(&roles.alpha_target)
            .take(if target.is_some() { 4 } else { 0 })
            .map(|at| input.names.name(*at))
            .collect(),
        picture: roles.label(),
        ..Inspection::default()
    }
}

fn untouched(pictures: &[Input]) -> Vec<String> {
    let used = pictures.iter().flat_map(|input| {
        let assigned = input.roles.assignments.iter().flat_map(|a| &a.channels);
        let layers = input.layers.iter().flat_map(|layer| &layer.channels);
        let further = input.roles.further.iter().flat_map(|own| &own.channels);
        let alpha = &input.roles.alpha_target;
        assigned
            .chain(layers)
            .chain(further)
            .chain(&input.roles.target)
            .chain(alpha)
    });
    let used: Vec<ChannelRef> = used.copied().collect();
    let Some(first) = pictures.first() else {
        return Vec::new();
    };
    let parts = first.file().parts().iter();
    let all = parts.flat_map(|part| {
        (0..part.header.channels.list.len()).map(move |channel| ChannelRef {
            file: 0,
            part: part.index,
            channel,
        })
    });
    let others = all.filter(|at| !used.contains(at));
    others.map(|at| first.names.name(at)).collect()
}

fn role_infos(input: &Input) -> Vec<RoleInfo> {
    let names = &input.names;
    let info = |role: &str, channels: &[_], rule: String| RoleInfo {
        role: role.to_owned(),
        channels: channels.iter().map(|&at| names.name(at)).collect(),
        rule,
    };
    let assigned = input
        .roles
        .assignments
        .iter()
        .map(|a| info(a.role.name(), &a.channels, a.rule.clone()));
    let layers = input.layers.iter().map(|layer| {
        info(
            "layer",
            &layer.channels,
            match layer.is_light {
                true => format!("asked for as {:?}", layer.name),
                false => format!("asked for as {:?}, no light", layer.name),
            },
        )
    });
    let further = input.roles.further.iter().map(|feature| {
        let noise = match feature.variance.channels() {
            channels if channels.is_empty() => "its variance estimated".to_owned(),
            channels => {
                let own: Vec<String> = channels.iter().map(|at| names.name(*at)).collect();
                format!("its variance from {}", own.join(" "))
            }
        };
        let rule = format!("asked for as a feature, {noise}");
        info("feature", &feature.channels, rule)
    });
    assigned.chain(layers).chain(further).collect()
}

fn variance_in_words(roles: &Roles) -> String {
    match roles.variance {
        Variance::Given { meaning, .. } => format!("given: {meaning}"),
        Variance::Halves { .. } => "half the difference of the half buffers, squared".into(),
        Variance::OtherFile(_) => {
            "half the difference to the other half, squared; the two images are averaged".into()
        }
        Variance::None => "estimated from the picture".into(),
    }
}

/// How what a frame shows would be found in the frames beside it.
fn motion_in_words(input: &Input) -> String {
    let names = |role| {
        let assignment = input.roles.assignment(role);
        let channels = assignment.into_iter().flat_map(|a| &a.channels);
        channels
            .map(|at| input.names.name(*at))
            .collect::<Vec<String>>()
    };
    let motion = input.motion();
    let frames = match (motion.backward, motion.forward) {
        (true, true) => "the frame before and after",
        (true, false) => "the frame before",
        (false, true) => "the frame after",
        (false, false) if motion.position => {
            let position = names(Role::Position).join(", ");
            return format!("world position ({position}), by search");
        }
        (false, false) => return "none in the file, taken for still".into(),
    };
    let vectors = [names(Role::Motion), names(Role::MotionForward)].concat();
    format!("vectors ({}), {frames}", vectors.join(", "))
}

fn part_info(part: &Part, passed_through: bool) -> PartInfo {
    let grid = &part.grid;
    let chunks = match grid.tiled() {
        true => {
            let levels = if grid.has_levels() {
                ", with smaller levels"
            } else {
                ""
            };
            let size = grid.bounds(0, 0).size;
            format!("tiles of {} x {}{levels}", size.0, size.1)
        }
        false => format!("scanline chunks of {}", grid.chunk_height()),
    };
    let channels = (part.header.channels.list.iter())
        .map(|channel| format!("{} ({})", channel.name, type_name(channel.sample_type)))
        .collect();
    PartInfo {
        label: part.label(),
        width: part.header.layer_size.0,
        height: part.header.layer_size.1,
        origin: [part.data_window().position.0, part.data_window().position.1],
        compression: part
            .compression()
            .map_or_else(String::new, |code| code.to_string()),
        chunks,
        channels,
        refusal: part.refusal.as_ref().map(ToString::to_string),
        passed_through,
    }
}

fn type_name(kind: exr::meta::attribute::SampleType) -> &'static str {
    use exr::meta::attribute::SampleType;
    match kind {
        SampleType::F16 => "half",
        SampleType::F32 => "float",
        SampleType::U32 => "uint",
    }
}

impl fmt::Display for PartInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y] = self.origin;
        let copied = match self.passed_through {
            true => ", copied as it is",
            false => "",
        };
        let compression = match self.compression.as_str() {
            "none" => "no",
            name => name,
        };
        writeln!(
            f,
            "  {}: {} x {} at ({x}, {y}), {compression} compression, {}{copied}",
            self.label, self.width, self.height, self.chunks
        )?;
        writeln!(f, "    {}", self.channels.join(", "))?;
        match &self.refusal {
            Some(refusal) => writeln!(f, "    not decoded: {refusal}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for RoleInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channels = self.channels.join(" ");
        writeln!(f, "  {:<16} {channels}  [{}]", self.role, self.rule)
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.path)?;
        self.parts.iter().try_for_each(|part| write!(f, "{part}"))?;
        self.picture(f)?;
        if !self.untouched.is_empty() {
            writeln!(f, "  kept as they are  {}", self.untouched.join(" "))?;
        }
        if let Some(pixels) = &self.pixels {
            write!(f, "{pixels}")?;
        }
        for other in &self.others {
            writeln!(f, "  denoised, too: {}", other.picture)?;
            other.picture(f)?;
            if let Some(pixels) = &other.pixels {
                write!(f, "{pixels}")?;
            }
        }
        match &self.problem {
            Some(problem) => writeln!(f, "  cannot be denoised: {problem}"),
            None => Ok(()),
        }
    }
}

impl Inspection {
    /// What is told of each picture.
    fn picture(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.roles.iter().try_for_each(|role| write!(f, "{role}"))?;
        if !self.written_to.is_empty() {
            writeln!(f, "  written to        {}", self.written_to.join(" "))?;
        }
        if let Some(variance) = &self.variance {
            writeln!(f, "  variance from     {variance}")?;
            writeln!(
                f,
                "  samples per pixel {}",
                self.samples.as_deref().unwrap_or("not stated")
            )?;
        }
        if let Some(motion) = &self.motion {
            writeln!(f, "  motion            {motion}")?;
        }
        if !self.missing.is_empty() {
            writeln!(
                f,
                "  no features       {} (denoised without)",
                self.missing.join(", ")
            )?;
        }
        if !self.offered.is_empty() {
            writeln!(
                f,
                "  more features     {} (used if asked for)",
                self.offered.join(", ")
            )?;
        }
        for note in &self.notes {
            writeln!(f, "  note: {note}")?;
        }
        for warning in &self.warnings {
            writeln!(f, "  warning: {warning}")?;
        }
        Ok(())
    }
}
