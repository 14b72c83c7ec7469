//! The grid in which places are given.

/// The grid in which places are given.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Grid {
    /// Number of cells along each axis.
    pub n: [i32; 3],
    /// Cells per length; 0 along an axis without extension.
    pub cells: [f32; 3],
    /// Whether the axis is periodic.
    pub wraps: [bool; 3],
}

impl Grid {
    /// The lengths of the axes, 0 of those that are not cut.
    pub fn lengths(&self) -> [f32; 3] {
        let length = |k: usize| self.n[k] as f32 / self.cells[k].max(f32::MIN_POSITIVE);
        [0, 1, 2].map(|k| if self.n[k] > 1 { length(k) } else { 0.0 })
    }
}
