//! Livewire: contours on slices by shortest paths along edges, filled and interpolated between slices.
