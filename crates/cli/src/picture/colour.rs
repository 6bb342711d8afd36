//! Colours that people with any colour vision can tell apart, on screen and in print.

use monro_geometry::Structure;

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub [u8; 3]);

impl Colour {
    /// Black.
    pub const BLACK: Self = Self([0, 0, 0]);
    /// White.
    pub const WHITE: Self = Self([255, 255, 255]);
    /// Orange of the Okabe-Ito palette.
    pub const ORANGE: Self = Self([230, 159, 0]);
    /// Sky blue of the Okabe-Ito palette.
    pub const SKY: Self = Self([86, 180, 233]);
    /// Green of the Okabe-Ito palette.
    pub const GREEN: Self = Self([0, 158, 115]);
    /// Yellow of the Okabe-Ito palette.
    pub const YELLOW: Self = Self([240, 228, 66]);
    /// Blue of the Okabe-Ito palette.
    pub const BLUE: Self = Self([0, 114, 178]);
    /// Vermilion of the Okabe-Ito palette.
    pub const VERMILION: Self = Self([213, 94, 0]);
    /// Purple of the Okabe-Ito palette.
    pub const PURPLE: Self = Self([204, 121, 167]);
    /// Path, entry and target of the plan: no structure has it.
    pub const PLAN: Self = Self([255, 64, 200]);
    /// The catheter.
    pub const CATHETER: Self = Self([245, 245, 245]);
    /// A light grey.
    pub const GREY: Self = Self([180, 180, 180]);

    /// `#rrggbb`.
    pub fn hex(self) -> String {
        let [r, g, b] = self.0;
        format!("#{r:02x}{g:02x}{b:02x}")
    }

    /// The colour of a structure label in cuts and 3D views; fluid and ventricles as in slices and in the editor, what is
    /// large in paler ones.
    pub const fn of_label(label: u16) -> Self {
        match label {
            1 => Self([222, 184, 150]),
            2 => Self([230, 226, 205]),
            3 => Self(Structure::Csf.colour()),
            4 => Self([216, 168, 168]),
            5 => Self(Structure::LeftLateralVentricle.colour()),
            6 => Self(Structure::RightLateralVentricle.colour()),
            7 => Self(Structure::ThirdVentricle.colour()),
            _ => Self::GREY,
        }
    }

    /// A colour for a label that is no known structure, far from its neighbours' in hue.
    pub fn of_number(label: u16) -> Self {
        Self(monro_case::glb::colour(usize::from(label)).map(|c| (255.0 * c).round() as u8))
    }

    /// Position `t` (0 to 1) on the cividis scale, dark blue to yellow, even in lightness.
    pub fn cividis(t: f64) -> Self {
        const STOPS: [[f64; 3]; 6] = [
            [0.0, 34.0, 78.0],
            [53.0, 69.0, 108.0],
            [102.0, 105.0, 112.0],
            [148.0, 142.0, 119.0],
            [200.0, 184.0, 102.0],
            [254.0, 232.0, 56.0],
        ];
        let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 } * (STOPS.len() - 1) as f64;
        let i = (t as usize).min(STOPS.len() - 2);
        let f = t - i as f64;
        Self(core::array::from_fn(|c| (STOPS[i][c] * (1.0 - f) + STOPS[i + 1][c] * f).round() as u8))
    }
}

/// Colours for the series of a plot, in order.
pub const SERIES: [Colour; 6] =
    [Colour::BLUE, Colour::VERMILION, Colour::GREEN, Colour::PURPLE, Colour::ORANGE, Colour::SKY];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_and_scale_ends() {
        assert_eq!(Colour::VERMILION.hex(), "#d55e00");
        assert_eq!(Colour::cividis(0.0), Colour([0, 34, 78]));
        assert_eq!(Colour::cividis(1.0), Colour([254, 232, 56]));
        assert_eq!(Colour::cividis(f64::NAN), Colour::cividis(-3.0));
    }
}
