//! How a part's data window is cut into chunks.

use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{IntegerBounds, LevelMode};
use exr::meta::{BlockDescription, compute_block_count, compute_level_count, compute_level_size};

/// A chunk's place in its part, as the chunk itself states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Scanline chunk: its top row in the coordinates of the data window.
    Line(i32),
    /// Tile: column, row, level in x, level in y.
    Tile([i32; 4]),
}

/// The chunks of one part: a grid at full resolution, and the smaller levels behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkGrid {
    origin_y: i32,
    width: usize,
    height: usize,
    chunk_width: usize,
    chunk_height: usize,
    levels: Option<(LevelMode, RoundingMode)>,
}

impl ChunkGrid {
    /// The grid of a part of the given data window; `lines` is the compression's rows per scanline chunk.
    pub fn new(window: IntegerBounds, cut: BlockDescription, lines: usize) -> Self {
        let (chunk_width, chunk_height, levels) = match cut {
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
            chunk_width,
            chunk_height,
            levels,
        }
    }

    /// The grid of the `rows` pixel rows from row `first` on, for a part without smaller levels; `first` is a multiple of
    /// the chunk height.
    pub fn restricted(&self, first: usize, rows: usize) -> Self {
        Self {
            // a row of a data window fits i32
            origin_y: self.origin_y + first as i32,
            height: rows,
            ..*self
        }
    }

    /// Chunks side by side at full resolution.
    pub fn columns(&self) -> usize {
        self.width.div_ceil(self.chunk_width)
    }

    /// Rows of chunks at full resolution.
    pub fn rows(&self) -> usize {
        self.height.div_ceil(self.chunk_height)
    }

    /// Pixel rows of a full chunk.
    pub fn chunk_height(&self) -> usize {
        self.chunk_height
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

    /// Which row of chunks holds pixel row `y` (from 0).
    pub fn chunk_row(&self, y: usize) -> usize {
        y / self.chunk_height
    }

    /// The pixels of a chunk of the full resolution, from (0, 0) at the data window's corner.
    pub fn bounds(&self, column: usize, row: usize) -> IntegerBounds {
        let (x, y) = (column * self.chunk_width, row * self.chunk_height);
        IntegerBounds {
            // a data window's sides fit i32
            position: Vec2(x as i32, y as i32),
            size: Vec2(
                self.chunk_width.min(self.width - x),
                self.chunk_height.min(self.height - y),
            ),
        }
    }

    /// The place that the `index`-th entry of the offset table stands for. `None` beyond the table.
    pub fn place(&self, index: usize) -> Option<Place> {
        let Some((mode, rounding)) = self.levels else {
            return (index < self.rows()).then(|| {
                Place::Line((i64::from(self.origin_y) + (index * self.chunk_height) as i64) as i32)
            });
        };
        let mut rest = index;
        for (level_x, level_y) in self.levels_of(mode, rounding) {
            let columns = self.level_columns(rounding, level_x);
            let rows = compute_block_count(
                compute_level_size(rounding, self.height, level_y),
                self.chunk_height,
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
            self.chunk_width,
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
