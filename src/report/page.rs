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
pub(crate) struct Picture {
    /// Pixels in a row.
    pub width: usize,
    /// Linear Rec. 709.
    pub colors: Vec<[f32; 3]>,
}

impl Picture {
    /// Number of rows.
    pub(crate) fn height(&self) -> usize {
        self.colors.len() / self.width.max(1)
    }

    /// The colours of a map from values to eight bits.
    pub(crate) fn of_map(values: &[f32], width: usize, color: impl Fn(f32) -> [u8; 3]) -> Self {
        let linear = |byte: u8| png::srgb_to_linear(f32::from(byte) / 255.0);
        Self { width, colors: values.iter().map(|v| color(*v).map(linear)).collect() }
    }

    /// Half as wide and as high, but for pictures of a single row or column.
    pub(crate) fn halved(&self) -> Self {
        if self.width < 2 || self.height() < 2 {
            return self.clone();
        }
        let (width, colors) = metric::halved(&self.colors, self.width);
        Self { width, colors }
    }

    /// A PNG for a screen, of at most 256 colours, as the address of an image.
    fn address(&self, display: &Display) -> String {
        let seen = |&[r, g, b]: &[f32; 3]| {
            let [r, g, b, _] = display.encode([r, g, b, 1.0]);
            [r, g, b]
        };
        let colors: Vec<[u8; 3]> = self.colors.iter().map(seen).collect();
        address(&png::encode_few(self.width, &colors))
    }

    /// A PNG that keeps the range, and the stops above 1 at which it ends. Three pictures of grey stand side by side: the
    /// logarithm of the light, and the shares of red and of blue in it. The script makes linear light of them, within 2 %
    /// and 0.8 % of it; what is [`RANGE`] stops below the end is black. Cloth is of nearly one hue, so that this takes half
    /// of what colours take.
    fn wide_range_address(&self) -> (String, f32) {
        let light = |c: &[f32; 3]| c.iter().map(|v| v.max(0.0)).sum::<f32>();
        let mut all: Vec<f32> = self.colors.iter().map(light).filter(|v| v.is_finite() && *v > 0.0).collect();
        all.sort_by(f32::total_cmp);
        // A few fireflies or lamps leave the range to the rest, and are cut.
        let bright = all.get(all.len() * 199 / 200).copied().unwrap_or(1.0);
        let end = (bright.log2() + HEADROOM).ceil();
        let mut bytes = vec![0_u8; self.colors.len() * 3];
        for (i, color) in self.colors.iter().enumerate() {
            let (x, y) = (i % self.width, i / self.width);
            let place = 3 * y * self.width + x;
            let light = light(color);
            // A cast takes what is not a number to 0, and what is too large to 255.
            bytes[place] = (255.5 + LEVELS * (light.log2() - end)).max(0.0) as u8;
            for (k, channel) in [0, 2].into_iter().enumerate() {
                bytes[place + (k + 1) * self.width] = (SHARES * color[channel].max(0.0) / light + 0.5) as u8;
            }
        }
        (address(&png::encode_gray(3 * self.width, &bytes)), end)
    }
}

/// Stops from the brightest to the darkest light of a picture that keeps its range.
const RANGE: f32 = 14.0;
/// Levels of a stop.
const LEVELS: f32 = 255.0 / RANGE;
/// Levels of a share of red or blue: more would keep noise that is not seen.
const SHARES: f32 = 63.0;
/// Stops by which the range ends above all but the brightest half per cent of pixels.
const HEADROOM: f32 = 2.0;

fn address(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

/// A whole page.
pub(crate) fn document(title: &str, body: &Markup) -> String {
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
pub(crate) fn figure(picture: &Picture, caption: &str) -> Markup {
    figure_shown(picture, &Display::default(), caption)
}

/// A picture with its caption, shown with an exposure and a tone curve.
pub(crate) fn figure_shown(picture: &Picture, display: &Display, caption: &str) -> Markup {
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
pub(crate) fn slider(id: &str, names: [&str; 2], pictures: [&Picture; 2], stops: f32) -> Markup {
    let (width, height) = (pictures[0].width, pictures[0].height());
    html! {
        figure.slider id=(id) data-width=(width) data-height=(height) {
            canvas width=(width) height=(height) style=(format!("width:{}px", shown_width(pictures[0]))) {}
            @for (side, picture) in ["a", "b"].into_iter().zip(pictures) {
                @let (address, end) = picture.wide_range_address();
                img.source data-side=(side) data-end=(end) data-range=(RANGE) data-shares=(SHARES) src=(address) alt="";
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
        let mut colors = vec![[0.3; 3], [1.0, 0.5, 0.25], [0.01, 0.003, 0.0], [0.0; 3], [3.0, 0.1, 2.0], [f32::NAN; 3]];
        colors.extend(vec![[0.2, 0.3, 0.1]; 594]);
        // One firefly in 600 pixels: cut, and nothing else.
        colors[599] = [1e6; 3];
        let picture = Picture { width: 6, colors: colors.clone() };
        let (text, end) = picture.wide_range_address();
        let bytes = STANDARD.decode(text.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x.png");
        std::fs::write(&path, bytes).unwrap();
        let image = crate::image::read(&path).unwrap();
        assert_eq!((image.width, image.height), (18, 100));
        for (i, color) in colors[..599].iter().enumerate().filter(|(i, _)| *i != 5) {
            let at = |plane: usize| {
                let value = image.channels[0].samples[i / 6 * 18 + plane * 6 + i % 6];
                (png::linear_to_srgb(value) * 255.0).round()
            };
            // As the script does.
            let light = if at(0) > 0.0 { (end + (at(0) - 255.0) / LEVELS).exp2() } else { 0.0 };
            let (r, b) = (at(1) / SHARES, at(2) / SHARES);
            let found = [light * r, light * (1.0 - r - b), light * b];
            let all: f32 = color.iter().sum();
            for (found, value) in found.into_iter().zip(color) {
                assert!((found - value).abs() <= 0.021 * value + 0.017 * all, "{color:?}: {found}");
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
