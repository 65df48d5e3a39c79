//! What a user may choose.

/// How many models must predict a pixel before no new one is built for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// One model: the papers' sparse placement.
    Fast,
    /// Four models.
    Balanced,
    /// Sixteen models.
    High,
}

/// Parameters of the method; `Copy`, shared by every tile of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Models that must predict a pixel before no new one is built for it, 1 to 361.
    pub coverage: u16,
}

impl Params {
    /// The parameters of a quality.
    pub const fn new(quality: Quality) -> Self {
        let coverage = match quality {
            Quality::Fast => 1,
            Quality::Balanced => 4,
            Quality::High => 16,
        };
        Self { coverage }
    }
}
