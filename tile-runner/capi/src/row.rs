//! Rows that are lent to C, as pointers to their planes.

use std::ptr::{null, null_mut};

use linpred::{Feature, ImageSize, InputRow, OutputRow, RowLayout, VarianceKind};

use crate::frame::MOST_LAYERS;
use crate::status::Failure;
use crate::versioned::Versioned;

/// What is known of the colour's noise.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_variance {
    /// Nothing: it is estimated from the picture.
    LINPRED_VARIANCE_ESTIMATED = 0,
    /// The variance of a pixel's mean.
    LINPRED_VARIANCE_OF_MEAN = 1,
    /// ((a - b) / 2)^2, of the means a and b of either half of the pixel's samples.
    LINPRED_VARIANCE_OF_HALVES = 2,
}

/// Whether rows have a feature.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_feature {
    /// They do not.
    LINPRED_FEATURE_ABSENT = 0,
    /// They do, and its noise is estimated.
    LINPRED_FEATURE_PRESENT = 1,
    /// They do, and have the variance of its mean.
    LINPRED_FEATURE_WITH_VARIANCE = 2,
}

/// What rows hold. LINPRED_LAYOUT_INIT sets the size; 0 is the default of each member, but an image has a width and a
/// height.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_layout {
    /// sizeof(linpred_layout).
    pub struct_size: usize,
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// One of linpred_variance.
    pub variance: i32,
    /// One of linpred_feature.
    pub normal: i32,
    /// One of linpred_feature.
    pub albedo: i32,
    /// One of linpred_feature.
    pub depth: i32,
    /// 1 if there is an alpha, 0 to 1, by which the colour is premultiplied.
    pub alpha: i32,
    /// More layers of radiance, denoised with the models of the colour: up to 1024.
    pub layers: u32,
    /// Other channels that are no light, denoised likewise: up to 1024.
    pub scalars: u32,
    /// Which of `further` have the variance of their mean, feature i by the bit 1 << i.
    pub further_with_variance: u32,
    /// Features beside those that light may follow (positions in the world, roughness, what another denoiser made): of
    /// each its channels, 1 to 3 and 6 in all; 0 behind the last.
    pub further: [u32; 6],
}

// SAFETY: numbers alone, the size first
unsafe impl Versioned for linpred_layout {
    const NAME: &'static str = "linpred_layout";
}

impl linpred_layout {
    /// What the library's rows hold then.
    pub(crate) fn layout(&self) -> Result<RowLayout, Failure> {
        let (width, height) = (self.width, self.height);
        let size = ImageSize::new(width, height).ok_or_else(|| {
            Failure::argument(format!(
                "{width} x {height} pixels are no image, whose sides are 1 to 2^31 - 1"
            ))
        })?;
        let mut layout = RowLayout::new(size, self.variance()?)
            .with_layers(count("layers", self.layers)?)
            .with_scalars(count("scalars", self.scalars)?);
        for (feature, kind) in Feature::ALL
            .into_iter()
            .zip([self.normal, self.albedo, self.depth])
        {
            layout = match kind {
                0 => layout,
                1 => layout.with_feature(feature),
                2 => layout.with_feature_and_variance(feature),
                other => {
                    let name = feature.name();
                    return Err(Failure::argument(format!(
                        "{name} is {other}, none of linpred_feature"
                    )));
                }
            };
        }
        let layout = self.with_further(layout)?;
        match self.alpha {
            0 => Ok(layout),
            1 => Ok(layout.with_alpha()),
            other => Err(Failure::argument(format!(
                "alpha is {other}, neither 0 nor 1"
            ))),
        }
    }

    fn with_further(&self, mut layout: RowLayout) -> Result<RowLayout, Failure> {
        let count = self.further.iter().take_while(|own| **own > 0).count();
        let (features, rest) = self.further.split_at(count);
        if rest.iter().any(|own| *own > 0) {
            return Err(Failure::argument(
                "further has a feature behind one of 0 channels",
            ));
        }
        if self.further_with_variance >> count != 0 {
            return Err(Failure::argument(format!(
                "further_with_variance is {}, but further has {count} features",
                self.further_with_variance
            )));
        }
        for (n, channels) in features.iter().enumerate() {
            let channels = *channels as usize;
            layout = match self.further_with_variance >> n & 1 {
                0 => layout.with_further_feature(channels)?,
                _ => layout.with_further_feature_and_variance(channels)?,
            };
        }
        Ok(layout)
    }

    fn variance(&self) -> Result<VarianceKind, Failure> {
        match self.variance {
            0 => Ok(VarianceKind::Estimated),
            1 => Ok(VarianceKind::OfMean),
            2 => Ok(VarianceKind::OfHalves),
            other => Err(Failure::argument(format!(
                "variance is {other}, none of linpred_variance"
            ))),
        }
    }
}

fn count(what: &str, count: u32) -> Result<usize, Failure> {
    match count as usize {
        few if few <= MOST_LAYERS => Ok(few),
        many => Err(Failure::argument(format!(
            "{many} {what}, and {MOST_LAYERS} at most"
        ))),
    }
}

/// A row to be filled. Every plane has `width` floats; planes that the layout does not ask for are NULL. What they
/// hold before is left over from other rows. The library makes and sizes it: a newer one may have more members
/// behind.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_input_row {
    /// Bytes of what the library filled in.
    pub struct_size: usize,
    /// Which row, from the top.
    pub y: usize,
    /// Pixels of a row.
    pub width: usize,
    /// Mean radiance, red green blue.
    pub colour: [*mut f32; 3],
    /// What the layout says; below 0 or not finite: not known.
    pub variance: [*mut f32; 3],
    /// Surface normal.
    pub normal: [*mut f32; 3],
    /// The variance of its mean.
    pub normal_variance: [*mut f32; 3],
    /// Surface albedo.
    pub albedo: [*mut f32; 3],
    /// The variance of its mean.
    pub albedo_variance: [*mut f32; 3],
    /// Distance from the camera.
    pub depth: *mut f32,
    /// The variance of its mean.
    pub depth_variance: *mut f32,
    /// Alpha, 0 to 1.
    pub alpha: *mut f32,
    /// Of layer i red, green and blue at 3 i, 3 i + 1, 3 i + 2.
    pub layers: *const *mut f32,
    /// Channels that are no light.
    pub scalars: *const *mut f32,
    /// The channels of the layout's `further` features, one after the other.
    pub further: *const *mut f32,
    /// The variances of their means; NULL for a channel whose variance is estimated.
    pub further_variance: *const *mut f32,
}

/// A denoised row. Every plane has `width` floats; planes that the layout does not ask for are NULL. The library
/// makes and sizes it: a newer one may have more members behind.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_output_row {
    /// Bytes of what the library filled in.
    pub struct_size: usize,
    /// Which row, from the top.
    pub y: usize,
    /// Pixels of a row.
    pub width: usize,
    /// Denoised radiance, red green blue; always finite.
    pub colour: [*const f32; 3],
    /// Estimated mean squared error of the denoised radiance, mean over the channels.
    pub error: *const f32,
    /// Half-width of the prediction windows that predicted the pixel, weighted mean, 0 to 9 pixels.
    pub radius: *const f32,
    /// Local rank of those models, weighted mean, 0 to 9, or to 15 with further features.
    pub rank: *const f32,
    /// Denoised alpha, 0 to 1.
    pub alpha: *const f32,
    /// Of layer i red, green and blue at 3 i, 3 i + 1, 3 i + 2.
    pub layers: *const *const f32,
    /// Denoised channels that are no light.
    pub scalars: *const *const f32,
}

/// A row that C fills. The pointers in `lent` are of `row` and of the other members, and hold until either changes.
pub(crate) struct LentInput {
    pub(crate) lent: linpred_input_row,
    layers: Vec<*mut f32>,
    scalars: Vec<*mut f32>,
    further: Vec<*mut f32>,
    further_variance: Vec<*mut f32>,
}

// SAFETY: pointers that C follows in the thread to which the row is lent; whoever moves this moves them with the row
unsafe impl Send for LentInput {}

impl LentInput {
    pub(crate) fn new() -> Self {
        Self {
            lent: linpred_input_row {
                struct_size: size_of::<linpred_input_row>(),
                y: 0,
                width: 0,
                colour: [null_mut(); 3],
                variance: [null_mut(); 3],
                normal: [null_mut(); 3],
                normal_variance: [null_mut(); 3],
                albedo: [null_mut(); 3],
                albedo_variance: [null_mut(); 3],
                depth: null_mut(),
                depth_variance: null_mut(),
                alpha: null_mut(),
                layers: null(),
                scalars: null(),
                further: null(),
                further_variance: null(),
            },
            layers: Vec::new(),
            scalars: Vec::new(),
            further: Vec::new(),
            further_variance: Vec::new(),
        }
    }

    /// Lends row `y`.
    pub(crate) fn lend(
        &mut self,
        layout: &RowLayout,
        y: usize,
        row: &mut InputRow,
    ) -> &linpred_input_row {
        let mut has_variance = [false; Feature::ALL.len()];
        for (has, feature) in has_variance.iter_mut().zip(Feature::ALL) {
            *has = layout.feature_variances[feature.range().start];
        }
        let has_noise = layout.variance != VarianceKind::Estimated;
        self.layers.clear();
        self.layers.extend(
            row.layers
                .iter_mut()
                .flatten()
                .map(|plane| plane.as_mut_ptr()),
        );
        self.scalars.clear();
        self.scalars
            .extend(row.scalars.iter_mut().map(|plane| plane.as_mut_ptr()));
        self.further.clear();
        self.further_variance.clear();
        for k in layout.further_features().flatten() {
            let variance = match layout.feature_variances[k] {
                true => start_mut(&mut row.feature_variances[k]),
                false => null_mut(),
            };
            self.further.push(start_mut(&mut row.features[k]));
            self.further_variance.push(variance);
        }
        let [normal, albedo, depth] = Feature::ALL;
        let [normal_has, albedo_has, depth_has] = has_variance;
        let [depth_plane] = three(row.feature_mut(depth), true);
        let [depth_variance] = three(row.feature_variance_mut(depth), depth_has);
        self.lent = linpred_input_row {
            struct_size: size_of::<linpred_input_row>(),
            y,
            width: layout.size.width(),
            colour: three(&mut row.colour, true),
            variance: three(&mut row.variance, has_noise),
            normal: three(row.feature_mut(normal), true),
            normal_variance: three(row.feature_variance_mut(normal), normal_has),
            albedo: three(row.feature_mut(albedo), true),
            albedo_variance: three(row.feature_variance_mut(albedo), albedo_has),
            depth: depth_plane,
            depth_variance,
            alpha: start_mut(&mut row.alpha),
            layers: start(&self.layers),
            scalars: start(&self.scalars),
            further: start(&self.further),
            further_variance: start(&self.further_variance),
        };
        &self.lent
    }

    /// Takes a variance below 0 for one that is not known, in the row that is lent.
    ///
    /// # Safety
    /// The row that was lent last is where it was, and nothing else refers to its planes.
    pub(crate) unsafe fn take_back(&self) {
        let row = &self.lent;
        let planes = [row.variance, row.normal_variance, row.albedo_variance];
        let planes = planes.into_iter().flatten().chain([row.depth_variance]);
        let planes = planes.chain(self.further_variance.iter().copied());
        for plane in planes.filter(|plane| !plane.is_null()) {
            // SAFETY: a plane of that row, whose length is the width
            let values = unsafe { std::slice::from_raw_parts_mut(plane, row.width) };
            for value in values.iter_mut().filter(|value| **value < 0.0) {
                *value = f32::NAN;
            }
        }
    }
}

/// A denoised row that C looks at. The pointers in `lent` are of the row and of the other members, and hold until
/// either changes.
pub(crate) struct LentOutput {
    pub(crate) lent: linpred_output_row,
    layers: Vec<*const f32>,
    scalars: Vec<*const f32>,
}

// SAFETY: pointers that C follows in the thread to which the row is lent; whoever moves this moves them with the row
unsafe impl Send for LentOutput {}

impl LentOutput {
    pub(crate) fn new() -> Self {
        Self {
            lent: linpred_output_row {
                struct_size: size_of::<linpred_output_row>(),
                y: 0,
                width: 0,
                colour: [null(); 3],
                error: null(),
                radius: null(),
                rank: null(),
                alpha: null(),
                layers: null(),
                scalars: null(),
            },
            layers: Vec::new(),
            scalars: Vec::new(),
        }
    }

    /// Lends row `y`.
    pub(crate) fn lend(&mut self, y: usize, row: &OutputRow) -> &linpred_output_row {
        self.layers.clear();
        self.layers
            .extend(row.layers.iter().flatten().map(|plane| plane.as_ptr()));
        self.scalars.clear();
        self.scalars
            .extend(row.scalars.iter().map(|plane| plane.as_ptr()));
        self.lent = linpred_output_row {
            struct_size: size_of::<linpred_output_row>(),
            y,
            width: row.error.len(),
            colour: row.colour.each_ref().map(|plane| plane.as_ptr()),
            error: row.error.as_ptr(),
            radius: row.radius.as_ptr(),
            rank: row.rank.as_ptr(),
            alpha: start(&row.alpha),
            layers: start(&self.layers),
            scalars: start(&self.scalars),
        };
        &self.lent
    }
}

/// Pointers to `N` planes; NULL for those that are empty or not to be filled.
fn three<const N: usize>(planes: &mut [Vec<f32>], are_filled: bool) -> [*mut f32; N] {
    let mut pointers = [null_mut(); N];
    for (pointer, plane) in pointers.iter_mut().zip(planes).filter(|_| are_filled) {
        *pointer = start_mut(plane);
    }
    pointers
}

fn start_mut(plane: &mut [f32]) -> *mut f32 {
    match plane.is_empty() {
        true => null_mut(),
        false => plane.as_mut_ptr(),
    }
}

fn start<T>(items: &[T]) -> *const T {
    match items.is_empty() {
        true => null(),
        false => items.as_ptr(),
    }
}
