//! The curve between light and values of pictures of eight bits.

/// The sRGB curve, IEC 61966-2-1: linear light to encoded value, cut to 0 to 1. NaN becomes 0.
pub fn linear_to_srgb(value: f32) -> f32 {
    if value <= 0.003_130_8 {
        (12.92 * value).max(0.0)
    } else if value < 1.0 {
        1.055 * libm::powf(value, 1.0 / 2.4) - 0.055
    } else if value.is_nan() {
        0.0
    } else {
        1.0
    }
}

/// The inverse of [`linear_to_srgb`] between 0 and 1, continued beyond.
pub fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.040_45 { value / 12.92 } else { libm::powf((value + 0.055) / 1.055, 2.4) }
}
