//! Whole images in the caller's memory.

use std::ffi::{c_char, c_void};

use linpred::image::Frame;
use linpred::job::check_memory;
use linpred::{Feature, OutputRow, RowSource};

use crate::handle::{Denoiser, call, linpred_denoiser};
use crate::names::{Input, Output};
use crate::raw_image::{Place, RawImage};
use crate::report::Done;
use crate::status::{Failure, linpred_status};
use crate::text::utf8;

/// More layers or scalars than an image has.
pub(crate) const MOST_LAYERS: usize = 1024;

/// Where the pixels of an image are, in the caller's memory.
#[derive(Default)]
pub(crate) struct Images {
    inputs: Vec<(Input, RawImage)>,
    outputs: Vec<(Output, RawImage)>,
}

/// Sets or replaces.
fn set<N: PartialEq>(all: &mut Vec<(N, RawImage)>, name: N, image: RawImage) {
    match all.iter_mut().find(|(known, _)| *known == name) {
        Some((_, known)) => *known = image,
        None => all.push((name, image)),
    }
}

/// Pixels of as many channels as what they are called has.
pub(crate) fn image(
    name: &str,
    channels: Option<usize>,
    place: &Place,
) -> Result<RawImage, Failure> {
    let told = |failure: Failure| Failure::argument(format!("{name}: {}", failure.message));
    let image = RawImage::new(place).map_err(told)?;
    match channels.filter(|channels| *channels != image.channels()) {
        None => Ok(image),
        Some(channels) => Err(Failure::argument(format!(
            "{name}: a format of {} channels, not {channels}",
            image.channels()
        ))),
    }
}

fn unknown(what: &str, name: &str) -> Failure {
    Failure::argument(format!("no {what} is called \"{name}\""))
}

impl Images {
    pub(crate) fn input(&self, name: &Input) -> Option<RawImage> {
        let mut found = self.inputs.iter().filter(|(known, _)| known == name);
        found.next().map(|(_, image)| *image)
    }

    /// The colour and all that its models are made of, as what the library reads.
    pub(crate) fn picture(&self) -> Result<Frame<'static>, Failure> {
        let colour = self.input(&Input::Colour);
        let colour = colour.ok_or_else(|| Failure::argument("no image \"colour\" is set"))?;
        let mut frame = Frame::new(colour)?;
        let noise = [Input::Variance, Input::HalfA, Input::HalfB].map(|name| self.input(&name));
        frame = match noise {
            [None, None, None] => frame,
            [Some(variance), None, None] => frame.with_variance(variance)?,
            [None, Some(a), Some(b)] => frame.with_halves(a, b)?,
            _ => {
                return Err(Failure::argument(
                    "what is set of \"variance\", \"half_a\" and \"half_b\" is neither the first alone nor the other two",
                ));
            }
        };
        for feature in Feature::ALL {
            let pixels = self.input(&Input::Feature(feature));
            let variance = self.input(&Input::FeatureVariance(feature));
            frame = match (pixels, variance) {
                (None, None) => frame,
                (Some(pixels), None) => frame.with_feature(feature, pixels)?,
                (Some(pixels), Some(variance)) => {
                    frame.with_feature_and_variance(feature, pixels, variance)?
                }
                (None, Some(_)) => {
                    let name = feature.name();
                    return Err(Failure::argument(format!(
                        "\"{name}_variance\" is set, but no \"{name}\""
                    )));
                }
            };
        }
        frame = self.with_further(frame)?;
        Ok(match self.input(&Input::Alpha) {
            Some(alpha) => frame.with_alpha(alpha)?,
            None => frame,
        })
    }

    /// With the features beside those that are known by their names.
    fn with_further(&self, mut frame: Frame<'static>) -> Result<Frame<'static>, Failure> {
        for (input, image) in &self.inputs {
            frame = match input {
                Input::Further(name) => {
                    let variance = self.input(&Input::FurtherVariance(name.clone()));
                    match variance {
                        None => frame.with_further_feature(name, *image)?,
                        Some(variance) => {
                            frame.with_further_feature_and_variance(name, *image, variance)?
                        }
                    }
                }
                Input::FurtherVariance(name)
                    if self.input(&Input::Further(name.clone())).is_none() =>
                {
                    return Err(Failure::argument(format!(
                        "\"{input}\" is set, but no \"feature.{name}\""
                    )));
                }
                _ => frame,
            };
        }
        Ok(frame)
    }

    /// The same with what is denoised beside the colour.
    fn frame(&self) -> Result<Frame<'static>, Failure> {
        let mut frame = self.picture()?;
        for (name, image) in &self.inputs {
            frame = match name {
                Input::Layer(_) => frame.with_layer(&name.to_string(), *image)?,
                Input::Scalar(_) => frame.with_scalar(&name.to_string(), *image)?,
                _ => frame,
            };
        }
        Ok(frame)
    }

    /// Where each plane of a row goes.
    fn targets(&self) -> Result<Targets, Failure> {
        if self.outputs.is_empty() {
            return Err(Failure::argument("no output is set"));
        }
        let mut targets = Targets::default();
        for (n, (name, image)) in self.outputs.iter().enumerate() {
            self.check(name, image, &self.outputs[..n])?;
            let position = |wanted: &Input, is_kind: fn(&Input) -> bool| {
                let names = self.inputs.iter().map(|(name, _)| name);
                names
                    .filter(|name| is_kind(name))
                    .position(|name| name == wanted)
            };
            let plane = match name {
                Output::Colour => Some(Plane::Colour),
                Output::Error => Some(Plane::Error),
                Output::Radius => Some(Plane::Radius),
                Output::Rank => Some(Plane::Rank),
                Output::Alpha => Some(Plane::Alpha),
                Output::Layer(_) => position(&name.input(), |name| matches!(name, Input::Layer(_)))
                    .map(Plane::Layer),
                Output::Scalar(_) => {
                    position(&name.input(), |name| matches!(name, Input::Scalar(_)))
                        .map(Plane::Scalar)
                }
            };
            targets.planes.extend(plane.map(|plane| (plane, *image)));
        }
        Ok(targets)
    }

    /// Refuses an output that has nothing to show, or no place of its own.
    fn check(
        &self,
        name: &Output,
        image: &RawImage,
        before: &[(Output, RawImage)],
    ) -> Result<(), Failure> {
        let Some(from) = self.input(&name.input()) else {
            let wanted = name.input();
            return Err(Failure::argument(format!(
                "the output \"{name}\" needs the image \"{wanted}\", which is not set"
            )));
        };
        if image.size() != from.size() {
            let [own, wanted] = [image, &from]
                .map(|image| format!("{} x {}", image.size().width(), image.size().height()));
            return Err(Failure::argument(format!(
                "the output \"{name}\" has {own} pixels, the image \"{}\" {wanted}",
                name.input()
            )));
        }
        if let Some((other, _)) = before.iter().find(|(_, other)| image.begins_within(other)) {
            return Err(Failure::argument(format!(
                "the outputs \"{other}\" and \"{name}\" begin at the same place"
            )));
        }
        let mut inputs = self.inputs.iter();
        match inputs.find(|(_, input)| !image.may_be_written_while_read(input)) {
            None => Ok(()),
            Some((input, _)) => Err(Failure::argument(format!(
                "the output \"{name}\" overlaps rows of the image \"{input}\" that are read later"
            ))),
        }
    }
}

/// What of a denoised row goes somewhere.
enum Plane {
    Colour,
    Error,
    Radius,
    Rank,
    Alpha,
    Layer(usize),
    Scalar(usize),
}

/// Where the planes of denoised rows go.
#[derive(Default)]
struct Targets {
    planes: Vec<(Plane, RawImage)>,
    clamped: u64,
}

impl Targets {
    /// # Safety
    /// The images are the caller's to write.
    unsafe fn write_row(&mut self, y: usize, row: &OutputRow) {
        for (plane, image) in &self.planes {
            let planes = match plane {
                Plane::Colour => &row.colour[..],
                Plane::Error => std::slice::from_ref(&row.error),
                Plane::Radius => std::slice::from_ref(&row.radius),
                Plane::Rank => std::slice::from_ref(&row.rank),
                Plane::Alpha => std::slice::from_ref(&row.alpha),
                Plane::Layer(n) => &row.layers[*n][..],
                Plane::Scalar(n) => std::slice::from_ref(&row.scalars[*n]),
            };
            for (channel, values) in planes.iter().enumerate() {
                // SAFETY: the caller's promise
                self.clamped += unsafe { image.write_row(channel, y, values) };
            }
        }
    }
}

/// # Safety
/// Every image can be read, every output written.
unsafe fn execute(denoiser: &mut Denoiser) -> Result<(), Failure> {
    denoiser.check_idle()?;
    let mut frame = denoiser.images.frame()?;
    let mut targets = denoiser.images.targets()?;
    let layout = frame.layout();
    check_memory(
        &layout,
        &denoiser.settings.options,
        denoiser.settings.memory_limit,
    )?;
    let (options, progress) = (denoiser.settings.options, denoiser.progress);
    let mut sink = |y: usize, row: &OutputRow| {
        // SAFETY: the caller's promise
        unsafe { targets.write_row(y, row) };
        Ok(())
    };
    let height = layout.size.height();
    let tell = &mut |rows| progress.tell(rows, height);
    let report = linpred::denoise(&mut frame, &mut sink, &options, tell)?;
    denoiser.done = Done::new(report, targets.clamped);
    Ok(())
}

/// Sets an image to be read. Its pixels are the caller's: nothing is copied, and linpred_execute() reads them. Pixel
/// x of row y begins at `data` + `byte_offset` + y * `row_stride` + x * `pixel_stride`, at any address; strides of 0
/// say that nothing lies between pixels or rows.
///
/// Names of three channels: "colour" (or "color": linear radiance, the one that must be set), "variance" (of a
/// pixel's mean; below 0 or not finite: not known), or in its place "half_a" and "half_b" (the means of either half
/// of a pixel's samples), "normal", "albedo", "layer.NAME" (more radiance, denoised with the models of the colour),
/// "normal_variance", "albedo_variance". Of one channel: "depth", "depth_variance", "alpha" (0 to 1, the colour is
/// premultiplied), "samples" (how many a pixel has, for linpred_sample_map()), "scalar.NAME" (what is no light: masks,
/// motion). Of one channel or three, as the format says: "feature.NAME" (what else light may follow: positions in the
/// world, roughness, what another denoiser made; all have 6 channels at most), "feature_variance.NAME" (of its mean;
/// estimated if it is not set). Pixels of the colour that are not finite are predicted from their neighbours, and
/// counted in the report.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero. The pixels can be read,
/// and nobody else writes them, in every linpred_execute() and linpred_sample_map() until the image is set anew or
/// unset.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_set_image(
    denoiser: *mut linpred_denoiser,
    name: *const c_char,
    data: *const c_void,
    format: i32,
    width: usize,
    height: usize,
    byte_offset: usize,
    pixel_stride: usize,
    row_stride: usize,
) -> linpred_status {
    let place = Place {
        data: data.cast_mut(),
        format,
        width,
        height,
        byte_offset,
        pixel_stride,
        row_stride,
    };
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            let name = utf8("the name of an image", name)?;
            let input = Input::parse(name).ok_or_else(|| unknown("image", name))?;
            let image = image(name, input.channels(), &place)?;
            let is_new = denoiser.images.input(&input).is_none();
            if is_new && denoiser.images.inputs.len() >= MOST_LAYERS {
                return Err(Failure::argument(format!(
                    "{name}: more than {MOST_LAYERS} images"
                )));
            }
            set(&mut denoiser.images.inputs, input, image);
            Ok(())
        })
    }
}

/// Sets where a result goes; arguments as for linpred_set_image(). It may be the memory of an image that is read:
/// with the same strides and the same start, or elsewhere in the same pixels, since a row is written once those up to
/// it have been read. Half formats hold up to 65504: what is beyond becomes that and is counted in the report.
///
/// Names of three channels: "colour" (or "color", "output"), "layer.NAME". Of one channel: "alpha", "scalar.NAME",
/// "error" (estimated mean squared error of the pixel, mean over the channels), "radius" and "rank" (of the models
/// behind it). Layers, scalars and alpha need images of the same names.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero. The pixels can be
/// written, and nobody else uses them, in every linpred_execute() until the output is set anew or unset.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_set_output(
    denoiser: *mut linpred_denoiser,
    name: *const c_char,
    data: *mut c_void,
    format: i32,
    width: usize,
    height: usize,
    byte_offset: usize,
    pixel_stride: usize,
    row_stride: usize,
) -> linpred_status {
    let place = Place {
        data,
        format,
        width,
        height,
        byte_offset,
        pixel_stride,
        row_stride,
    };
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            let name = utf8("the name of an output", name)?;
            let output = Output::parse(name).ok_or_else(|| unknown("output", name))?;
            let image = image(name, Some(output.channels()), &place)?;
            set(&mut denoiser.images.outputs, output, image);
            Ok(())
        })
    }
}

/// Takes back linpred_set_image(). An image that was not set is no error.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_unset_image(
    denoiser: *mut linpred_denoiser,
    name: *const c_char,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            let name = utf8("the name of an image", name)?;
            let input = Input::parse(name).ok_or_else(|| unknown("image", name))?;
            denoiser.images.inputs.retain(|(known, _)| *known != input);
            Ok(())
        })
    }
}

/// Takes back linpred_set_output(). An output that was not set is no error.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `name` is NULL or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_unset_output(
    denoiser: *mut linpred_denoiser,
    name: *const c_char,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            let name = utf8("the name of an output", name)?;
            let output = Output::parse(name).ok_or_else(|| unknown("output", name))?;
            denoiser
                .images
                .outputs
                .retain(|(known, _)| *known != output);
            Ok(())
        })
    }
}

/// Denoises the images into the outputs, and returns when that is done. All images have the size of the colour. It
/// can be called again: with the same images, whose pixels may have changed, or with others. After a failure on the
/// way outputs hold rows of either kind.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; what the images and outputs were set to is there, as
/// linpred_set_image() and linpred_set_output() say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_execute(denoiser: *mut linpred_denoiser) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe { call(denoiser, |denoiser| execute(denoiser)) }
}
