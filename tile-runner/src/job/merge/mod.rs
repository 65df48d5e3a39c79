//! Passes of one picture into one file, as if all their samples had been taken at once.
//!
//! All passes are read side by side, row by row, and merged in an order that is theirs alone: that of the files' checksums. Nothing grows with the height of the image. What can be
//! told from the headers is checked before the output is begun, and what only the pixels tell before it gets its name.

mod agreement;
mod channels;
mod output;
mod pass;
mod pool;
mod rows;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::channels::{FeatureRequest, RoleRequest};
use crate::error::Error;
use crate::exr_file::output::check_output;
use crate::job::input::Remark;
use crate::job::memory::{self, DEFAULT_MEMORY_LIMIT, MemoryPlan};
use crate::job::output_name::check_output_name;
use crate::job::plan::merge_plan;
use crate::job::request::InputRequest;
use output::Output;
use pass::Pass;
use rows::MergedRows;

/// Which passes are merged, and how their channels are read.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MergeRequest {
    /// The passes, in any order.
    pub passes: Vec<PathBuf>,
    /// How roles are assigned, in each of them; [`spp`](RoleRequest::spp) is what each pixel of each has.
    pub roles: RoleRequest,
    /// Bytes that may be used.
    pub memory_limit: u64,
}

impl MergeRequest {
    /// These passes, with the roles that their names suggest, in up to [`DEFAULT_MEMORY_LIMIT`] bytes.
    pub fn new(passes: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        Self {
            passes: passes.into_iter().map(Into::into).collect(),
            roles: RoleRequest::default(),
            memory_limit: DEFAULT_MEMORY_LIMIT,
        }
    }

    /// Roles as asked for.
    pub fn with_roles(self, roles: RoleRequest) -> Self {
        Self { roles, ..self }
    }

    /// With another limit on memory.
    pub fn with_memory_limit(self, memory_limit: u64) -> Self {
        Self {
            memory_limit,
            ..self
        }
    }
}

/// What came of a merge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Merged {
    /// Passes.
    pub passes: usize,
    /// Pixels of the first picture.
    pub pixels: u64,
    /// Samples per pixel of it: the mean.
    pub samples: f64,
    /// The fewest.
    pub fewest: f64,
    /// The most.
    pub most: f64,
    /// Pixels of all passes whose colour, or count of samples, is no finite number: they took no part.
    pub lost: u64,
    /// Bytes of memory that the process had in use at most so far, where the system tells.
    pub peak_memory: Option<u64>,
}

/// Passes that are about to be merged.
///
/// Of each pixel the output has: the mean of all samples of every layer; the variance that all of them have together (of the mean, or of one sample, as the passes state it), NaN with fewer
/// than two samples or where the passes do not know it; second moments and half buffers averaged by the samples; identifiers and integers from the pass that has most samples there; and the
/// number of samples (`sampleCount`, or the channel that states it in the passes). A pixel without samples is 0.
/// What was averaged is written as `float`. A pixel of a pass whose colour is not finite takes no part, and is counted.
#[derive(Debug)]
pub struct Merging {
    passes: Vec<Pass>,
    /// Samples per pixel of each, whatever it says.
    asked: Option<u32>,
    memory_limit: u64,
}

impl Merging {
    /// Opens the passes of `request`, and checks what their headers tell.
    ///
    /// [`Error::Usage`] without passes, or if one is given twice; [`Error::Invalid`] if their data windows or channels differ, one is damaged, or was denoised; [`Error::Incomplete`] if one
    /// does not state its samples per pixel; [`Error::Unsupported`] if one cannot be decoded, or has parts of several data windows.
    pub fn open(request: &MergeRequest) -> Result<Self, Error> {
        check_once(&request.passes)?;
        // the variances of whatever else may be a feature of the merged image are put together, too
        let roles = RoleRequest {
            features: vec![FeatureRequest::Auto],
            ..request.roles.clone()
        };
        let open = |path: &PathBuf| {
            let input = InputRequest::new(path)
                .with_roles(roles.clone())
                .with_memory_limit(Some(request.memory_limit));
            Pass::open(&input)
        };
        let passes: Result<Vec<Pass>, Error> = request.passes.iter().map(open).collect();
        let mut passes = passes?;
        passes.sort_by_cached_key(Pass::order);
        let Some((first, others)) = passes.split_first() else {
            return Err(Error::Usage("no passes to merge".into()));
        };
        for other in others {
            first.check_alike(other)?;
        }
        Ok(Self {
            passes,
            asked: request.roles.spp,
            memory_limit: request.memory_limit,
        })
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.passes[0].pictures[0].height()
    }

    /// What there is to say before they are merged: what is odd about each, and what is left out.
    pub fn remarks(&self) -> Vec<Remark> {
        let mut remarks: Vec<Remark> = Vec::new();
        for pass in &self.passes {
            let name = pass.name();
            let warnings = pass.pictures.iter().flat_map(|p| &p.roles.warnings);
            remarks.extend(warnings.map(|text| Remark::Warning(format!("{name}: {text}"))));
        }
        let notes = &self.passes[0].channels.notes;
        remarks.extend(notes.iter().map(|note| Remark::Note(note.clone())));
        remarks
    }

    /// What [`write`](Self::write) holds in memory.
    pub fn plan(&self) -> MemoryPlan {
        let inputs = self.passes.iter();
        let inputs = inputs.map(|pass| (&pass.pictures[0], pass.read_channels()));
        let writing = output::bytes(&self.passes[0]);
        merge_plan(
            &inputs.collect::<Vec<_>>(),
            writing,
            MergedRows::bytes(&self.passes),
        )
    }

    /// Merges them into `output`, which is there when all is done, or not at all. The same passes give the same bytes, in whatever order they were named.
    /// `progress` is told how many rows are done.
    ///
    /// [`Error::Usage`] if `output` has the name of another format or is a pass; [`Error::OverLimit`] or [`Error::Budget`] if the [`plan`](Self::plan) is more than may or can be had;
    /// [`Error::Invalid`] if a pass is damaged, is not of one picture with the others, or has samples of another one; [`Error::Cancelled`] soon after `stop` is set.
    pub fn write(
        &self,
        output: &Path,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Merged, Error> {
        let inputs: Vec<&Path> = self.passes.iter().map(|pass| pass.file().path()).collect();
        check_output_name(output)?;
        check_output(output, &inputs)?;
        let plan = self.plan();
        plan.check(self.memory_limit)?;
        memory::check_available(&plan, 1)?;
        let mut rows = MergedRows::new(&self.passes, self.memory_limit)?;
        let mut file = Output::create(output, &self.passes, self.asked)?;
        let mut merged = Merged::of(self);
        for y in 0..self.height() {
            if stop.load(Ordering::Relaxed) {
                return Err(Error::Cancelled);
            }
            rows.merge(y)?;
            merged.add_row(rows.totals(0));
            file.write_row(&rows.planes)?;
            progress(y + 1);
        }
        self.check_pixels(&rows)?;
        file.finish()?;
        merged.lost = rows.lost();
        merged.samples /= merged.pixels as f64;
        merged.peak_memory = memory::peak();
        Ok(merged)
    }

    /// What the pixels tell of whether passes belong together.
    fn check_pixels(&self, rows: &MergedRows) -> Result<(), Error> {
        self.check_copies(rows)?;
        let shares = rows.agreements.iter().map(|agreement| agreement.verdict());
        let odd = self.passes.iter().zip(shares);
        let odd = odd.filter_map(|(pass, verdict)| verdict.map(|(by, share)| (pass, by, share)));
        let Some((pass, by, share)) = odd.max_by(|a, b| a.2.total_cmp(&b.2)) else {
            return Ok(());
        };
        let who = match &self.passes[..] {
            [a, b] => format!(
                "{} and {} are not passes of one picture",
                a.name(),
                b.name()
            ),
            _ => format!(
                "{} is not of one picture with the other passes",
                pass.name()
            ),
        };
        Err(Error::Invalid(format!(
            "{who}: by {} they differ at {:.0} % of the pixels, far beyond their noise",
            by.in_words(),
            100.0 * share
        )))
    }

    /// Refuses samples that would count twice. Pictures without anything in them are alike without being copies.
    fn check_copies(&self, rows: &MergedRows) -> Result<(), Error> {
        for (n, (a, content)) in self.passes.iter().zip(&rows.contents).enumerate() {
            for (b, other) in self.passes[..n].iter().zip(&rows.contents) {
                let same = a.made_of.iter().any(|part| b.made_of.contains(part));
                let what = match (content.sum() == other.sum(), same) {
                    (true, _) => {
                        "hold the same pixels: one is a copy, or was rendered with the same seed"
                    }
                    (false, true) => "have a pass in common, which was merged into one of them",
                    (false, false) => continue,
                };
                if content.varies {
                    return Err(Error::Invalid(format!(
                        "{} and {} {what}; its samples would count twice",
                        b.name(),
                        a.name()
                    )));
                }
            }
        }
        Ok(())
    }
}

impl Merged {
    fn of(merging: &Merging) -> Self {
        let size = merging.passes[0].pictures[0].size();
        Self {
            passes: merging.passes.len(),
            pixels: size.pixels(),
            fewest: f64::INFINITY,
            ..Self::default()
        }
    }

    /// Counts the samples of a row's pixels; their mean is a sum until the end.
    fn add_row(&mut self, totals: &[f64]) {
        for &total in totals {
            self.samples += total;
            self.fewest = self.fewest.min(total);
            self.most = self.most.max(total);
        }
    }
}

/// [`Error::Usage`] if a file is named twice, by whatever names.
fn check_once(passes: &[PathBuf]) -> Result<(), Error> {
    for (n, pass) in passes.iter().enumerate() {
        let same = |other: &&PathBuf| same_file::is_same_file(pass, other).unwrap_or(false);
        if let Some(other) = passes[..n].iter().find(same) {
            return Err(Error::Usage(format!(
                "{} and {} are one file: its samples would count twice",
                other.display(),
                pass.display()
            )));
        }
    }
    Ok(())
}
