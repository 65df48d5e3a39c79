//! Planes as the core's kernels after the blend want them: padded on both sides.

use linpred_core::{FINISH_PADDING, finish_columns};

use crate::row::RowLayout;

/// A row of a plane, with columns beyond the image on both sides.
#[derive(Debug)]
pub(crate) struct Plane {
    width: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Zeros.
    pub(crate) fn new(width: usize) -> Self {
        Self {
            width,
            values: vec![0.0; finish_columns(width)],
        }
    }

    /// No plane, where an image has none.
    pub(crate) fn none() -> Self {
        Self {
            width: 0,
            values: Vec::new(),
        }
    }

    /// Columns of the image; 0 if there is no plane.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Every column, or none.
    pub(crate) fn padded(&self) -> &[f32] {
        &self.values
    }

    /// Every column; those of `zeros` if it has none.
    pub(crate) fn padded_or<'a>(&'a self, zeros: &'a Self) -> &'a [f32] {
        if self.values.is_empty() {
            &zeros.values
        } else {
            &self.values
        }
    }

    /// Every column, to be filled; call [`Self::pad`] or [`Self::pad_with_zeros`] afterwards.
    pub(crate) fn padded_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Whether there is a plane.
    pub(crate) fn is_some(&self) -> bool {
        !self.values.is_empty()
    }

    /// The columns of the image, to be filled; call [`Self::pad`] or [`Self::pad_with_zeros`] afterwards.
    pub(crate) fn image_mut(&mut self) -> &mut [f32] {
        &mut self.values[FINISH_PADDING..FINISH_PADDING + self.width]
    }

    /// The columns of the image; none if there is no plane.
    pub(crate) fn image(&self) -> &[f32] {
        let image = FINISH_PADDING..FINISH_PADDING + self.width;
        self.values.get(image).unwrap_or_default()
    }

    /// Gives the columns beyond the image the values of the nearest ones.
    pub(crate) fn pad(&mut self) {
        let end = FINISH_PADDING + self.width;
        let (first, last) = (self.values[FINISH_PADDING], self.values[end - 1]);
        self.values[..FINISH_PADDING].fill(first);
        self.values[end..].fill(last);
    }

    /// Makes the columns beyond the image 0.
    pub(crate) fn pad_with_zeros(&mut self) {
        self.values[..FINISH_PADDING].fill(0.0);
        self.values[FINISH_PADDING + self.width..].fill(0.0);
    }

    /// Takes the values of a row of the image.
    pub(crate) fn copy(&mut self, row: &[f32]) {
        self.image_mut().copy_from_slice(row);
        self.pad();
    }

    /// Takes what a function of the column gives.
    pub(crate) fn fill(&mut self, value: impl Fn(usize) -> f32) {
        for (x, own) in self.image_mut().iter_mut().enumerate() {
            *own = value(x);
        }
        self.pad();
    }
}

/// Radiance of a row: of the colour, and of the layers, which go the same way. And what is no light, which is smoothed with it, but neither cleared nor
/// scaled.
pub(crate) struct Radiance {
    colour: [Plane; 3],
    layers: Vec<[Plane; 3]>,
    scalars: Vec<Plane>,
}

impl Radiance {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        3 + layout.following_planes()
    }

    pub(crate) fn new(layout: &RowLayout) -> Self {
        let planes = || std::array::from_fn(|_| Plane::new(layout.size.width()));
        Self {
            colour: planes(),
            layers: (0..layout.layers).map(|_| planes()).collect(),
            scalars: (0..layout.all_scalars())
                .map(|_| Plane::new(layout.size.width()))
                .collect(),
        }
    }

    /// The planes of the colour.
    pub(crate) fn colour(&self) -> [&[f32]; 3] {
        self.colour.each_ref().map(Plane::padded)
    }

    /// The planes of the colour, then those of the layers.
    pub(crate) fn light(&self) -> impl Iterator<Item = &Plane> {
        self.colour.iter().chain(self.layers.iter().flatten())
    }

    /// The same, to be filled.
    pub(crate) fn light_mut(&mut self) -> impl Iterator<Item = &mut Plane> {
        let layers = self.layers.iter_mut().flatten();
        self.colour.iter_mut().chain(layers)
    }

    /// The planes of what is no light.
    pub(crate) fn scalars(&self) -> impl Iterator<Item = &Plane> {
        self.scalars.iter()
    }

    /// The same, to be filled.
    pub(crate) fn scalars_mut(&mut self) -> impl Iterator<Item = &mut Plane> {
        self.scalars.iter_mut()
    }

    /// Every plane, the light first.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Plane> {
        self.light().chain(&self.scalars)
    }

    /// The same, to be filled.
    pub(crate) fn all_mut(&mut self) -> impl Iterator<Item = &mut Plane> {
        let layers = self.layers.iter_mut().flatten();
        let light = self.colour.iter_mut().chain(layers);
        light.chain(&mut self.scalars)
    }
}

/// Bytes of planes of an image this wide, saturating.
pub(crate) fn padded_bytes(width: usize, planes: usize) -> u64 {
    let columns = finish_columns(width).saturating_mul(size_of::<f32>());
    (columns as u64).saturating_mul(planes as u64)
}
