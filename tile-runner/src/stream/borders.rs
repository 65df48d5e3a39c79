//! Pixels beyond the image: the nearest one, or the image mirrored.

/// `position` mirrored at both ends of 0..length, without repeating the ends.
pub(crate) fn mirrored(position: isize, length: usize) -> usize {
    let last = length as isize - 1;
    let inside = position.abs();
    clamped(
        if inside > last {
            2 * last - inside
        } else {
            inside
        },
        length,
    )
}

/// The nearest of 0..length.
pub(crate) fn clamped(position: isize, length: usize) -> usize {
    position.clamp(0, length as isize - 1) as usize
}

/// The values of `row` from `position` on; beyond its ends, the nearest.
pub(crate) fn copy_clamped(row: &[f32], position: isize, target: &mut [f32]) {
    let start = clamped(position, row.len());
    let before = start.saturating_add_signed(-position).min(target.len());
    let (left, rest) = target.split_at_mut(before);
    left.fill(row[0]);
    let inside = rest.len().min(row.len() - start);
    let (middle, right) = rest.split_at_mut(inside);
    middle.copy_from_slice(&row[start..start + inside]);
    right.fill(row[row.len() - 1]);
}

/// The values of `row` from `position` on; beyond its ends, its mirror image (see [`mirrored`]).
pub(crate) fn copy_mirrored(row: &[f32], position: isize, target: &mut [f32]) {
    let inside = usize::try_from(position).ok();
    match inside.and_then(|first| row.get(first..first + target.len())) {
        Some(values) => target.copy_from_slice(values),
        None => {
            for (position, value) in (position..).zip(target) {
                *value = row[mirrored(position, row.len())];
            }
        }
    }
}
