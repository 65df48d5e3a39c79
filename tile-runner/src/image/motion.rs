//! What a file tells of where its surfaces are in the frames beside it.

use crate::channels::motion::{forget_origins, to_ours};
use crate::channels::names::ChannelRef;
use crate::channels::presets::Role;
use crate::channels::roles::Roles;
use crate::error::Error;
use crate::image::source::Planes;
use crate::row::{InputRow, Motion};

/// A motion vector, and what makes its components ours.
#[derive(Clone, Copy, Debug)]
struct Vector {
    channels: [ChannelRef; 2],
    signs: [f32; 2],
}

impl Vector {
    fn of(roles: &Roles, role: Role) -> Option<Self> {
        let assignment = roles.assignment(role)?;
        Some(Self {
            channels: assignment.channels[..].try_into().ok()?,
            signs: assignment.signs,
        })
    }

    /// Reads row `y`, right and down.
    fn read(&self, planes: &mut Planes, y: usize, out: &mut [Vec<f32>; 2]) -> Result<(), Error> {
        for (at, plane) in self.channels.into_iter().zip(&mut *out) {
            planes.plane(at, y, plane)?;
        }
        to_ours(out, self.signs);
        Ok(())
    }
}

/// The channels that tell of motion.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MotionChannels {
    backward: Option<Vector>,
    forward: Option<Vector>,
    position: Option<[ChannelRef; 3]>,
}

impl MotionChannels {
    /// Those that have the roles.
    pub(crate) fn of(roles: &Roles) -> Self {
        let position = roles.assignment(Role::Position);
        Self {
            backward: Vector::of(roles, Role::Motion),
            forward: Vector::of(roles, Role::MotionForward),
            position: position.and_then(|found| found.channels[..].try_into().ok()),
        }
    }

    /// What rows hold of them.
    pub(crate) fn layout(&self) -> Motion {
        Motion {
            backward: self.backward.is_some(),
            forward: self.forward.is_some(),
            position: self.position.is_some(),
        }
    }

    /// Every one.
    pub(crate) fn all(&self) -> impl Iterator<Item = ChannelRef> + use<> {
        let vectors = self.backward.into_iter().chain(self.forward);
        let position = self.position.into_iter().flatten();
        vectors.flat_map(|vector| vector.channels).chain(position)
    }

    /// Reads row `y` of them.
    pub(super) fn read(
        &self,
        planes: &mut Planes,
        y: usize,
        row: &mut InputRow,
    ) -> Result<(), Error> {
        if let Some(backward) = &self.backward {
            backward.read(planes, y, &mut row.backward)?;
        }
        if let Some(forward) = &self.forward {
            forward.read(planes, y, &mut row.forward)?;
        }
        for (at, plane) in self.position.iter().flatten().zip(&mut row.position) {
            planes.plane(*at, y, plane)?;
        }
        forget_origins(&mut row.position);
        Ok(())
    }
}
