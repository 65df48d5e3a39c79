//! How a part's data window is cut into blocks.

use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{IntegerBounds, LevelMode};
use exr::meta::{BlockDescription, compute_block_count, compute_level_count, compute_level_size};

/// A chunk's place in its part, as the chunk itself states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Scanline block: its top row in the coordinates of the data window.
    Line(i32),
    /// Tile: column, row, level in x, level in y.
    Tile([i32; 4]),
}

/// The blocks of one part: a grid at full resolution, and the smaller levels behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockGrid {
    origin_y: i32,
    width: usize,
    height: usize,
    block_width: usize,
    block_height: usize,
    levels: Option<(LevelMode, RoundingMode)>,
}

impl BlockGrid {
    /// The grid of a part of the given data window; `lines` is the compression's rows per scanline block.
    pub fn new(window: IntegerBounds, blocks: BlockDescription, lines: usize) -> Self {
        let (block_width, block_height, levels) = match blocks {
            BlockDescription::ScanLines => (window.size.0, lines, None),
            BlockDescription::Tiles(tiles) => (
                tiles.tile_size.0,
                tiles.tile_size.1,
                Some((tiles.level_mode, tiles.rounding_mode)),
            ),
        };
        Self {
            origin_y: window.position.1,
            width: window.size.0,
            height: window.size.1,
            block_width,
            block_height,
            levels,
        }
    }

    /// The grid of the `rows` pixel rows from row `first` on, for a part without smaller levels; `first` is a multiple of
    /// the block height.
    pub fn restricted(&self, first: usize, rows: usize) -> Self {
        Self {
            // a row of a data window fits i32
            origin_y: self.origin_y + first as i32,
            height: rows,
            ..*self
        }
    }

    /// Blocks side by side at full resolution.
    pub fn columns(&self) -> usize {
        self.width.div_ceil(self.block_width)
    }

    /// Rows of blocks at full resolution.
    pub fn rows(&self) -> usize {
        self.height.div_ceil(self.block_height)
    }

    /// Pixel rows of a full block.
    pub fn block_height(&self) -> usize {
        self.block_height
    }

    /// Whether the part is tiled.
    pub fn tiled(&self) -> bool {
        self.levels.is_some()
    }

    /// Whether smaller levels follow the full resolution.
    pub fn has_levels(&self) -> bool {
        matches!(
            self.levels,
            Some((LevelMode::MipMap | LevelMode::RipMap, _))
        )
    }

    /// Which row of blocks holds pixel row `y` (from 0).
    pub fn block_row(&self, y: usize) -> usize {
        y / self.block_height
    }

    /// The pixels of a block of the full resolution, from (0, 0) at the data window's corner.
    pub fn bounds(&self, column: usize, row: usize) -> IntegerBounds {
        let (x, y) = (column * self.block_width, row * self.block_height);
        IntegerBounds {
            // a data window's sides fit i32
            position: Vec2(x as i32, y as i32),
            size: Vec2(
                self.block_width.min(self.width - x),
                self.block_height.min(self.height - y),
            ),
        }
    }

    /// The place that the `index`-th entry of the offset table stands for. `None` beyond the table.
    pub fn place(&self, index: usize) -> Option<Place> {
        let Some((mode, rounding)) = self.levels else {
            return (index < self.rows()).then(|| {
                Place::Line((i64::from(self.origin_y) + (index * self.block_height) as i64) as i32)
            });
        };
        let mut rest = index;
        for (level_x, level_y) in self.levels_of(mode, rounding) {
            let columns = self.level_columns(rounding, level_x);
            let rows = compute_block_count(
                compute_level_size(rounding, self.height, level_y),
                self.block_height,
            );
            if rest < columns * rows {
                let tile = [rest % columns, rest / columns, level_x, level_y];
                return Some(Place::Tile(tile.map(|v| v as i32)));
            }
            rest -= columns * rows;
        }
        None
    }

    fn level_columns(&self, rounding: RoundingMode, level_x: usize) -> usize {
        compute_block_count(
            compute_level_size(rounding, self.width, level_x),
            self.block_width,
        )
    }

    fn levels_of(&self, mode: LevelMode, rounding: RoundingMode) -> Vec<(usize, usize)> {
        let x = compute_level_count(rounding, self.width);
        let y = compute_level_count(rounding, self.height);
        match mode {
            LevelMode::Singular => vec![(0, 0)],
            LevelMode::MipMap => (0..x.max(y)).map(|l| (l, l)).collect(),
            LevelMode::RipMap => (0..y)
                .flat_map(|ly| (0..x).map(move |lx| (lx, ly)))
                .collect(),
        }
    }
}
