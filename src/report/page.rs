//! Pages that need nothing but themselves: pictures as PNG in the text, one style, one script.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::image::{
    metric,
    png::{self, Display},
};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// A picture for a page: linear colours, the top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: usize,
    /// Linear Rec. 709.
    pub colors: Vec<[f32; 3]>,
}

impl Picture {
    /// Number of rows.
    pub fn height(&self) -> usize {
        self.colors.len() / self.width.max(1)
    }

    /// The colours of a map from values to eight bits.
    pub fn of_map(values: &[f32], width: usize, color: impl Fn(f32) -> [u8; 3]) -> Self {
        let linear = |byte: u8| png::srgb_to_linear(f32::from(byte) / 255.0);
        Self { width, colors: values.iter().map(|v| color(*v).map(linear)).collect() }
    }

    /// Half as wide and as high, but for pictures of a single row or column.
    pub fn halved(&self) -> Self {
        if self.width < 2 || self.height() < 2 {
            return self.clone();
        }
        let (width, colors) = metric::halved(&self.colors, self.width);
        Self { width, colors }
    }

    /// A PNG for a screen, as the address of an image.
    fn address(&self, display: &Display) -> String {
        let bytes: Vec<u8> = self
            .colors
            .iter()
            .flat_map(|[r, g, b]| {
                let [r, g, b, _] = display.encode([*r, *g, *b, 1.0]);
                [r, g, b]
            })
            .collect();
        address(&png::encode(self.width, self.height(), &bytes))
    }

    /// A PNG that keeps the range: three mantissas for each pixel on the left, the exponent they share on the right.
    /// The script makes linear light of it, (m + 0.5) / 256 x 2^(e - 128), within 0.4 % of the brightest channel.
    fn wide_range_address(&self) -> String {
        let mut bytes = vec![0_u8; self.colors.len() * 6];
        for (i, color) in self.colors.iter().enumerate() {
            let (x, y) = (i % self.width, i / self.width);
            let most = color.iter().copied().fold(0.0, f32::max);
            let exponent = if most.is_finite() && most > 1e-30 { most.log2().floor() as i32 + 1 } else { -127 };
            let place = (y * 2 * self.width + x) * 3;
            for (k, value) in color.iter().enumerate() {
                // A cast takes what is not a number or negative to 0, and what is too large to 255.
                bytes[place + k] = (value * 256.0 * (-exponent as f32).exp2()) as u8;
                bytes[place + 3 * self.width + k] = (exponent + 128).clamp(0, 255) as u8;
            }
        }
        address(&png::encode(2 * self.width, self.height(), &bytes))
    }
}

fn address(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

/// A whole page.
pub fn document(title: &str, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { main { (body) } script { (PreEscaped(SCRIPT)) } }
        }
    }
    .into_string()
}

/// A picture with words below it.
pub fn figure(picture: &Picture, caption: &str) -> Markup {
    figure_shown(picture, &Display::default(), caption)
}

/// A picture with its caption, shown with an exposure and a tone curve.
pub fn figure_shown(picture: &Picture, display: &Display, caption: &str) -> Markup {
    html! {
        figure {
            img src=(picture.address(display)) width=(shown_width(picture)) alt=(caption);
            figcaption { (caption) }
        }
    }
}

/// Small pictures are shown larger, by a whole number.
fn shown_width(picture: &Picture) -> usize {
    picture.width * (480 / picture.width.max(1)).clamp(1, 4)
}

/// Two pictures of the same size, one over the other, with a line between them that follows the pointer, and an exposure
/// that begins at `stops`.
pub fn slider(id: &str, names: [&str; 2], pictures: [&Picture; 2], stops: f32) -> Markup {
    let (width, height) = (pictures[0].width, pictures[0].height());
    html! {
        figure.slider id=(id) data-width=(width) data-height=(height) {
            canvas width=(width) height=(height) style=(format!("width:{}px", shown_width(pictures[0]))) {}
            @for (side, picture) in ["a", "b"].into_iter().zip(pictures) {
                img.source data-side=(side) src=(picture.wide_range_address()) alt="";
            }
            figcaption { span { "◀ " (names[0]) } span { (names[1]) " ▶" } }
            label { "exposure " input type="range" min="-10" max="10" step="0.25" value=(stops); output { (stops) } " stops" }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_range_pictures_keep_their_light() {
        let colors =
            vec![[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [1e-4, 3e-5, 0.0], [1234.5, 1.0, 1000.0], [0.3; 3], [7.0; 3]];
        let picture = Picture { width: 3, colors: colors.clone() };
        let text = picture.wide_range_address();
        let bytes = STANDARD.decode(text.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x.png");
        std::fs::write(&path, bytes).unwrap();
        let image = crate::image::read(&path).unwrap();
        assert_eq!((image.width, image.height), (6, 2));
        for (i, color) in colors.iter().enumerate() {
            let at = |x: usize, k: usize| {
                let byte = png::linear_to_srgb(image.rgb().unwrap()[k][i / 3 * 6 + x]) * 255.0;
                f64::from(byte.round())
            };
            let scale = 2f64.powf(at(i % 3 + 3, 0) - 128.0) / 256.0;
            let most = f64::from(color.iter().copied().fold(0.0, f32::max));
            for (k, value) in color.iter().enumerate() {
                let found = (at(i % 3, k) + 0.5) * scale;
                assert!((found - f64::from(*value)).abs() <= 0.004 * most + 1e-30, "{color:?}: {found}");
            }
        }
    }

    #[test]
    fn halved_pictures_keep_their_mean() {
        let colors = (0..15).map(|i| [i as f32, 0.0, 2.0]).collect();
        let half = Picture { width: 5, colors }.halved();
        assert_eq!((half.width, half.height()), (2, 1));
        assert_eq!(half.colors, [[3.0, 0.0, 2.0], [5.0, 0.0, 2.0]]);
        let line = Picture { width: 1, colors: vec![[1.0; 3]; 4] };
        assert_eq!(line.halved(), line);
    }

    #[test]
    fn pages_escape_names_and_stand_alone() {
        let picture = Picture { width: 2, colors: vec![[0.5; 3]; 4] };
        let body = slider("x", ["<a>", "b & c"], [&picture, &picture], 0.0);
        let page = document("a < b", &body);
        assert!(page.contains("&lt;a&gt;") && page.contains("b &amp; c") && page.contains("<title>a &lt; b</title>"));
        assert!(!page.contains("http"), "nothing is loaded from elsewhere");
    }
}
