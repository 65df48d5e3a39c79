//! The arguments as they are typed.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;

use crate::channels::{FeatureRequest, Mapping, PRESET_NAMES};
use crate::image::OutputCompression;
use crate::job::{Band, parse_frames};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};

use super::number::{
    parse_budget, parse_coverage, parse_error, parse_reach, parse_spp, parse_threads,
};
use super::size::parse_size;

/// What the end of the process says.
macro_rules! exit_codes {
    () => {
        "Exit codes: 0 done, 2 usage, 3 input, 4 memory budget, 130 or 143 stopped by SIGINT (Ctrl-C) or SIGTERM, 1 anything else."
    };
}

/// Denoises Monte Carlo renders by linear predictions from their feature layers.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = exit_codes!()
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) log: LogArguments,
}

#[derive(Debug, Args)]
pub(crate) struct LogArguments {
    /// How messages are written to standard error
    #[arg(long, value_enum, default_value_t = LogFormat::Text, global = true)]
    pub(crate) log_format: LogFormat,
    /// Say more
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub(crate) verbose: u8,
    /// Say only what went wrong
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
}

impl LogArguments {
    /// Nothing said but the format.
    pub(crate) fn plain(log_format: LogFormat) -> Self {
        Self {
            log_format,
            verbose: 0,
            quiet: false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    Text,
    Json,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Denoise an image
    Denoise(DenoiseArguments),
    /// Say what a file holds and which channel plays which role
    Inspect(InspectArguments),
    /// Measure how far an image is from a reference
    Compare(CompareArguments),
    /// Put the bands of an image together
    Stitch(StitchArguments),
    /// Say where a renderer should take more samples
    SampleMap(SampleMapArguments),
    /// Put the passes of an image together: renders of it with samples of their own
    Merge(MergeArguments),
}

impl Command {
    /// Whether a worker of Open Job Description is told how far the command is.
    pub(crate) fn is_told_to_openjd(&self) -> bool {
        match self {
            Self::Denoise(denoise) => denoise.progress == ProgressStyle::Openjd,
            Self::Inspect(inspect) => inspect.survey.progress == Some(ProgressStyle::Openjd),
            Self::Stitch(stitch) => stitch.progress == StitchProgress::Openjd,
            Self::SampleMap(map) => map.progress == ProgressStyle::Openjd,
            Self::Merge(merge) => merge.progress == ProgressStyle::Openjd,
            Self::Compare(_) => false,
        }
    }
}

#[derive(Debug, Args)]
#[command(after_help = concat!(exit_codes!(), "

Examples:
  linpred denoise noisy.exr -o clean.exr
  linpred denoise noisy.exr -o clean.exr --quality high --error-layer
  linpred denoise noisy.exr -o preview.exr --quality fast --compression none
  linpred denoise moments.exr -o clean.exr --preset mitsuba --spp 64
  linpred denoise odd.exr -o clean.exr --map colour=main --map albedo=kd --map variance=none
  linpred denoise first_half.exr --other-half second_half.exr -o clean.exr
  linpred denoise 'shot.####.exr' -o 'clean.####.exr' --frames 1-100x2 --skip-existing
  linpred denoise 'shot.####.exr' -o 'clean.####.exr' --temporal
  linpred denoise shot.0042.exr -o clean.0042.exr --temporal --before 'shot.####.exr' --after 'shot.####.exr'"))]
pub(crate) struct DenoiseArguments {
    #[command(flatten)]
    pub(crate) input: InputArguments,
    /// The denoised image, OpenEXR as the input; every channel that is not denoised is kept as it is
    #[arg(short, long, value_name = "CLEAN.exr")]
    pub(crate) output: PathBuf,
    /// How much time to spend for how much accuracy
    #[arg(long, value_enum, default_value_t = QualityName::Balanced)]
    pub(crate) quality: QualityName,
    /// The number behind --quality, which stays what decides whether models differ in their features: how many good models must predict a pixel before no new one is built for it, 1 to 1024
    #[arg(long, value_name = "MODELS", value_parser = parse_coverage)]
    pub(crate) coverage: Option<u16>,
    /// Which formulas fit, choose and blend the models
    #[arg(long, value_enum, default_value_t = FormulasName::Robust)]
    pub(crate) formulas: FormulasName,
    /// Add the channel linpred.error: the estimated mean squared error of each denoised pixel, mean over the channels, radiance squared; its square
    /// root is a standard error
    #[arg(long)]
    pub(crate) error_layer: bool,
    /// Add the channels linpred.radius and linpred.rank: the size and the rank of the models behind each pixel; with --temporal also linpred.frames: of how
    /// many frames it is made
    #[arg(long)]
    pub(crate) models_layer: bool,
    /// How what is denoised is stored; parts of which nothing is are copied as they are stored. 'keep': as in the input, but with zip where that would lose data of what is added
    /// or kept. 'zip' and 'none' are the fastest; 'dwaa' loses data of every channel called R, G, B, RY, BY or Y,
    /// that of a normal, too
    #[arg(long, value_parser = compression_names(), default_value = "keep")]
    pub(crate) compression: OutputCompression,
    /// Threads that compute, at most one on each processor; the result does not depend on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Memory that may be used, such as 256M; a job that needs more is refused before it begins [default: 2G]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Frames of a sequence, such as 1-100x2,205 (or 1-100:2,205); the file names hold ####, %04d or $F4 for the number [default: those that
    /// exist]
    #[arg(long, value_name = "FRAMES", value_parser = parse_frames)]
    pub(crate) frames: Option<std::vec::Vec<u32>>,
    /// Have the frames of a sequence help each other, so that they do not flicker: each pixel is averaged with what shows the same surface in the N frames before and after
    /// it, which are found by motion vectors, else by positions in the world, else in the same place; 1 to 8, the default 3. The input holds a place for the number,
    /// or --before and --after say which frames are beside it
    #[arg(
        long,
        value_name = "N",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "3",
        value_parser = parse_reach
    )]
    pub(crate) temporal: Option<NonZeroUsize>,
    /// The frames before a single image: 'shot.####.exr', by the number in the image's name, or each by its name, the nearest first
    #[arg(long, value_name = "FRAME.exr", requires = "temporal")]
    pub(crate) before: Vec<PathBuf>,
    /// The frames after it, likewise
    #[arg(long, value_name = "FRAME.exr", requires = "temporal")]
    pub(crate) after: Vec<PathBuf>,
    /// Leave frames alone whose output exists
    #[arg(long)]
    pub(crate) skip_existing: bool,
    /// Only the i-th of N bands of the image, with the bits that the whole image would have; see 'linpred stitch'
    #[arg(long, value_name = "i/N", value_parser = Band::parse)]
    pub(crate) band: Option<Band>,
    /// Print the plan (roles, memory) and do nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// How progress is shown on standard error: a bar on a terminal, nothing on a pipe, unless said otherwise
    #[arg(long, value_enum, default_value_t = ProgressStyle::Auto)]
    pub(crate) progress: ProgressStyle,
}

/// Compressions by their names.
fn compression_names() -> impl TypedValueParser<Value = OutputCompression> {
    let names = OutputCompression::NAMES.map(|(name, _)| name);
    PossibleValuesParser::new(names).try_map(|name| OutputCompression::parse(&name))
}

#[derive(Debug, Args)]
pub(crate) struct InputArguments {
    /// The noisy image
    #[arg(value_name = "NOISY.exr")]
    pub(crate) noisy: PathBuf,
    /// Whose channel names to expect
    #[arg(long, value_parser = PRESET_NAMES, default_value = "auto")]
    pub(crate) preset: String,
    /// Give a role to a layer or channel; wins over the preset; 'none' leaves the role empty. Roles: colour, alpha, albedo, normal,
    /// depth, variance, sample-variance, second-moment, albedo-variance, normal-variance, depth-variance, half-a, half-b,
    /// samples; for --temporal motion (where a surface was in the frame before: two channels of pixels, right and down, with a minus before one that counts the other
    /// way), motion-forward (in the frame after), position (in the world)
    #[arg(long, value_name = "ROLE=CHANNEL", value_parser = Mapping::parse)]
    pub(crate) map: Vec<Mapping>,
    /// A feature beside normal, albedo and depth that light may follow: a layer or channel such as a position in the world, a roughness, a second normal, what another
    /// denoiser made; P, P:X,Z for some of its channels, P=PVariance where its variance has a name of its own. 1 to 3 channels each, 6 in all. 'auto': those that the
    /// renderer is known to write
    #[arg(long, value_name = "NAME", value_parser = FeatureRequest::parse)]
    pub(crate) feature: Vec<FeatureRequest>,
    /// Samples per pixel, where the file does not state them or states them wrongly
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub(crate) spp: Option<NonZeroU32>,
    /// The image from the other half of the samples: the two are averaged, their difference gives the variance
    #[arg(long, value_name = "SECOND.exr")]
    pub(crate) other_half: Option<PathBuf>,
    /// More layers to denoise, with the models of the colour, so that they still sum up: 'diffuse,light_*'. Without a wildcard also channels that are no light:
    /// a depth, a mask. The alpha is denoised in any case (--map alpha=none keeps it)
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) layers: Vec<String>,
    /// Whether windows wrap around the left and right ends of the picture, as in a panorama
    #[arg(long, value_enum, default_value_t = WrapName::Auto)]
    pub(crate) wrap: WrapName,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum WrapName {
    /// If the header says so (envmap), or if the picture is twice as wide as high and its ends meet
    Auto,
    /// They do
    X,
    /// They do not
    None,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  linpred inspect noisy.exr
  linpred inspect noisy.exr --json
  linpred inspect noisy.exr --pixels               what a run would skip, pixels that are not finite, ranges
  linpred inspect noisy.exr --map albedo=kd        what would be used with this option")]
pub(crate) struct InspectArguments {
    #[command(flatten)]
    pub(crate) input: InputArguments,
    #[command(flatten)]
    pub(crate) survey: SurveyArguments,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SurveyArguments {
    /// Read the pixels, too: what a run would skip, which features never vary, which pixels are not finite, ranges of radiance and variance
    #[arg(long)]
    pub(crate) pixels: bool,
    /// Threads that compute, at most one on each processor; the figures do not depend on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads, requires = "pixels")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Memory that may be used, such as 256M [default: 2G]
    #[arg(long, value_name = "SIZE", value_parser = parse_size, requires = "pixels")]
    pub(crate) max_memory: Option<u64>,
    /// How progress is shown on standard error, as for denoise [default: auto]
    #[arg(long, value_enum, requires = "pixels")]
    pub(crate) progress: Option<ProgressStyle>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
What is measured (a: the image, f: the reference; luminance is 0.2126 R + 0.7152 G + 0.0722 B; images are mirrored at their borders,
but for FLIP, which repeats the outermost pixels):
  rMSE       mean over pixels and channels of ((a - f)^2 - var f) / (f^2 + 0.01); var f is the reference's own variance of the mean, read
             from its channels variance.R, variance.G and variance.B if it has them
             The reference against itself comes out slightly below 0: its own noise is taken off all the same
  MSE        mean over pixels and channels of (a - f)^2
  PSNR       of both images clamped to 0..1 and coded as sRGB, dB; 120 for equal ones
  FLIP       HDR-FLIP (Andersson et al. 2021), mean over the pixels: how different the images look shown in turn, 0 to 1. 67 pixels per
             degree, ACES, exposures from f, as flip-evaluator 1.7 has them by default; differs from its figure by its rounding (4e-6 or
             less at 256 x 256), and takes negative radiance for black. Most of the time goes here: 0.11 CPU seconds per megapixel for
             each exposure, one for each stop from the median to the maximum of f; half as much again with --input
  mean       radiance, mean over pixels and channels
  energy     mean of a / mean of f: 1 if no light is lost
  bias       mean of (A - F) / (F + 0.01), with A and F the mean luminances of 17 x 17 pixels: light lost or won locally
  off5       share of the pixels where that is beyond +-5 %
  top1       mean luminance of a / of f over the brightest 1 % of f: 1 if highlights stay
  pinholes   pixels per megapixel darker than 0.4 times the median of the 25 around and than half the darkest of f's 9
  sparks     pixels per megapixel brighter than 2.5 times that median and than twice the brightest of f's 9; for both, 0.02 of the mean of
             f is added to each luminance
  gain       rMSE of the --input / rMSE of the image
  worst      the pixels of the largest relative squared error, and the squares of 32 x 32 pixels with the largest sum of it
One measure alone misleads: rMSE pays for darkness, and does not see specks. Samples that are not finite are counted, and take part
in no figure. With --input, each is measured of that, too.

Examples:
  linpred compare clean.exr reference.exr
  linpred compare clean.exr reference.exr --input noisy.exr --picture seen.png
  linpred compare clean.exr reference.exr --heatmap where.png --json")]
pub(crate) struct CompareArguments {
    /// The image
    #[arg(value_name = "CLEAN.exr")]
    pub(crate) image: PathBuf,
    /// What it should be
    #[arg(value_name = "REFERENCE.exr")]
    pub(crate) reference: PathBuf,
    /// What the image was made of: measure that too, and the gain
    #[arg(long, value_name = "NOISY.exr")]
    pub(crate) input: Option<PathBuf>,
    /// Write a picture of the relative error: black 1e-4 or less, white 1 or more, cyan not a number
    #[arg(long, value_name = "OUT.png")]
    pub(crate) heatmap: Option<PathBuf>,
    /// Write a picture to look at, in sRGB: side by side the --input, the image, the reference and the relative error, and below them the five worst
    /// places of 32 x 32 pixels, each 4 times as large, without the error
    #[arg(long, value_name = "OUT.png")]
    pub(crate) picture: Option<PathBuf>,
    /// Threads that compute FLIP; no figure depends on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Memory that may be used, such as 256M [default: 2G]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Which layer is the colour, as for denoise (--map colour=LAYER)
    #[arg(long, value_name = "ROLE=CHANNEL", value_parser = Mapping::parse)]
    pub(crate) map: Vec<Mapping>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  linpred denoise noisy.exr -o band1.exr --band 1/2       on one machine
  linpred denoise noisy.exr -o band2.exr --band 2/2       on another
  linpred stitch band*.exr -o clean.exr")]
pub(crate) struct StitchArguments {
    /// The bands, in any order
    #[arg(value_name = "BAND.exr", required = true)]
    pub(crate) bands: Vec<PathBuf>,
    /// The whole image
    #[arg(short, long, value_name = "CLEAN.exr")]
    pub(crate) output: PathBuf,
    /// How progress is shown on standard error
    #[arg(long, value_enum, default_value_t = StitchProgress::None)]
    pub(crate) progress: StitchProgress,
}

/// Stitching takes as long as a copy: nobody watches it but a farm, which wants to know of every task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StitchProgress {
    /// Lines for the workers of Open Job Description, as for denoise
    Openjd,
    /// Nothing
    None,
}

#[derive(Debug, Args)]
#[command(
    group = ArgGroup::new("goal").required(true).multiple(true).args(["budget", "target_error"]),
    after_help = "\
The map has the window of the picture and one channel, samples: whole numbers as floats. They sum up to the budget exactly, and are the same on any
number of threads. Averages are over what was rendered: rows and columns along the edges that are black in every channel take no part, unless a channel
says that they have samples. The image must say how many samples its pixels have (a channel, an attribute, or --spp); with variances the map is better.

An error is relative here: the estimated squared error of a denoised pixel over the mean square of its colour and 0.003, averaged over 5 x 5 pixels; the
predicted error of the image is the mean of that, and comparable with the rMSE of 'linpred compare'.

Exit codes: 10 the error is as small as --target-error already, and the map all 0; else as for denoise.

Examples:
  linpred sample-map noisy.exr -o map.exr --budget 8
  linpred sample-map noisy.exr -o map.exr --target-error 0.005
  linpred sample-map noisy.exr -o map.exr --target-error 0.005 --budget 16 --picture map.png
  linpred merge noisy.exr second_pass.exr -o all.exr       once the renderer has followed the map"
)]
pub(crate) struct SampleMapArguments {
    #[command(flatten)]
    pub(crate) input: InputArguments,
    /// The map, OpenEXR
    #[arg(short, long, value_name = "MAP.exr")]
    pub(crate) output: PathBuf,
    /// How many more samples a pixel should get, on average
    #[arg(long, value_name = "SAMPLES", value_parser = parse_budget)]
    pub(crate) budget: Option<f64>,
    /// As many samples as it takes until the predicted error of the denoised image is so small; with --budget, no more than that
    #[arg(long, value_name = "ERROR", value_parser = parse_error)]
    pub(crate) target_error: Option<f64>,
    /// How the image is denoised to see where it is wrong; a better quality takes longer and finds no better map
    #[arg(long, value_enum, default_value_t = QualityName::Fast)]
    pub(crate) quality: QualityName,
    /// Print the plan (roles, memory) and do nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Write a picture of the map: black nothing, white the most that a pixel gets, by the logarithm
    #[arg(long, value_name = "OUT.png")]
    pub(crate) picture: Option<PathBuf>,
    /// Threads that compute, at most one on each processor; the result does not depend on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Memory that may be used, such as 256M; a job that needs more is refused before it begins [default: 2G]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// How progress is shown on standard error, as for denoise
    #[arg(long, value_enum, default_value_t = ProgressStyle::Auto)]
    pub(crate) progress: ProgressStyle,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = concat!(exit_codes!(), "

What comes out is what one render of all the samples would have given: of every pixel the mean, the variance of all samples together, and their number,
in the channel sampleCount unless the passes state it in one of their own. Passes have the same size and channels, and seeds of their own. Their order does
not matter. Merged passes can be merged with more.

Examples:
  linpred merge pass1.exr pass2.exr pass3.exr -o all.exr
  linpred merge all.exr pass4.exr -o more.exr
  linpred merge pass*.exr -o all.exr --spp 16
  linpred denoise all.exr -o clean.exr"))]
pub(crate) struct MergeArguments {
    /// The passes, in any order
    #[arg(value_name = "PASS.exr", required = true)]
    pub(crate) passes: Vec<PathBuf>,
    /// All of them in one
    #[arg(short, long, value_name = "ALL.exr")]
    pub(crate) output: PathBuf,
    /// Whose channel names to expect
    #[arg(long, value_parser = PRESET_NAMES, default_value = "auto")]
    pub(crate) preset: String,
    /// Give a role to a layer or channel of every pass, as for denoise (--map samples=CHANNEL)
    #[arg(long, value_name = "ROLE=CHANNEL", value_parser = Mapping::parse)]
    pub(crate) map: Vec<Mapping>,
    /// Samples per pixel of each of the passes, where they do not state them or state them wrongly
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub(crate) spp: Option<NonZeroU32>,
    /// Memory that may be used, such as 256M; it grows with the number of passes [default: 2G]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Print the plan of memory and do nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// How progress is shown on standard error, as for denoise
    #[arg(long, value_enum, default_value_t = ProgressStyle::Auto)]
    pub(crate) progress: ProgressStyle,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QualityName {
    /// A pixel is predicted well by one model; all see the same features
    Fast,
    /// By three, which differ in the features that they see
    Balanced,
    /// By sixteen, likewise
    High,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormulasName {
    /// This program's
    Robust,
    /// Those of Moon et al. 2015 to the letter, a baseline: one model per pixel whatever the quality, unless --coverage is given
    Literal,
    /// Those of Moon et al. 2014, weighted local regression, to the letter, a slow baseline: a fit at every pixel, whatever the quality and --coverage. It
    /// depends on the unit of radiance, and its light may be negative
    Wlr,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressStyle {
    /// A bar on a terminal, nothing elsewhere
    Auto,
    /// A bar
    Tty,
    /// A line for every tenth
    Plain,
    /// A JSON object for every hundredth: file (the input), frame (its number, of a sequence), rows (done), of (all rows), percent, seconds (since it
    /// began)
    Json,
    /// Lines for the workers of Open Job Description: openjd_progress, in hundredths of all frames, openjd_status, openjd_fail
    Openjd,
    /// Nothing
    None,
}
