//! Few colours for many: small pictures for pages.

/// A picture of at most 256 colours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Indexed {
    /// The colours.
    pub(super) palette: Vec<[u8; 3]>,
    /// Which of them each pixel has.
    pub(super) pixels: Vec<u8>,
}

/// Most colours of a palette.
const MOST: usize = 256;

impl Indexed {
    /// By median cut (Heckbert 1982): the box of colours whose widest side is longest is cut at its median, until there are
    /// 256. Exact where a picture has no more colours than that.
    pub(super) fn new(colors: &[[u8; 3]]) -> Self {
        let mut different = colors.to_vec();
        different.sort_unstable();
        different.dedup();
        if different.len() <= MOST {
            let index = |c: &[u8; 3]| different.binary_search(c).expect("every colour is in the list") as u8;
            return Self { pixels: colors.iter().map(index).collect(), palette: different };
        }
        let mut boxes: Vec<Vec<u32>> = vec![(0..colors.len() as u32).collect()];
        while boxes.len() < MOST {
            let side = |b: &Vec<u32>| widest(b.iter().map(|&i| colors[i as usize]));
            // Different colours are left, for there are more of them than boxes.
            let sides = boxes.iter().map(side).enumerate();
            let Some((at, (_, channel))) = sides.max_by_key(|(_, (width, _))| *width) else { break };
            let mut cut = boxes.swap_remove(at);
            cut.sort_by_key(|&i| colors[i as usize][channel]);
            // Equal values stay together.
            let value = |i: usize| colors[cut[i] as usize][channel];
            let middle = value(cut.len() / 2);
            let above = cut.partition_point(|&i| colors[i as usize][channel] < middle);
            let above =
                if above == 0 { cut.partition_point(|&i| colors[i as usize][channel] <= middle) } else { above };
            boxes.push(cut.split_off(above));
            boxes.push(cut);
        }
        let mut pixels = vec![0; colors.len()];
        let mut palette = Vec::with_capacity(MOST);
        for (index, members) in boxes.into_iter().enumerate() {
            let mut sums = [0_u64; 3];
            for i in &members {
                pixels[*i as usize] = index as u8;
                sums.iter_mut().zip(colors[*i as usize]).for_each(|(sum, c)| *sum += u64::from(c));
            }
            let count = members.len().max(1) as u64;
            palette.push(sums.map(|sum| ((sum + count / 2) / count) as u8));
        }
        Self { palette, pixels }
    }
}

/// The longest side of the box around colours, and its channel.
fn widest(colors: impl Iterator<Item = [u8; 3]>) -> (u8, usize) {
    let (low, high) = colors.fold(([255; 3], [0; 3]), |(low, high), c| {
        (std::array::from_fn(|k| c[k].min(low[k])), std::array::from_fn(|k| c[k].max(high[k])))
    });
    (0..3).map(|k: usize| (high[k].saturating_sub(low[k]), k)).max_by_key(|side| side.0).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;

    #[test]
    fn few_colours_are_kept_and_many_are_met_closely() {
        let few: Vec<[u8; 3]> = (0..1000).map(|i| [(i % 16) as u8 * 10, (i % 5) as u8, 7]).collect();
        let indexed = Indexed::new(&few);
        assert!(indexed.pixels.iter().zip(&few).all(|(i, c)| indexed.palette[usize::from(*i)] == *c));
        // Cloth of one hue, lighter and darker, with noise.
        let mut stream = Stream::new(3);
        let many: Vec<[u8; 3]> = (0..4800)
            .map(|_| {
                let (light, noise) = (stream.next(), [(); 3].map(|()| 12.0 * (stream.next() - 0.5)));
                std::array::from_fn(|k| ([200.0, 160.0, 90.0][k] * light + noise[k]) as u8)
            })
            .collect();
        let indexed = Indexed::new(&many);
        assert_eq!(indexed.palette.len(), MOST);
        let off = |(i, c): (&u8, &[u8; 3])| -> f64 {
            let found = indexed.palette[usize::from(*i)];
            (0..3).map(|k| (f64::from(found[k]) - f64::from(c[k])).powi(2)).sum::<f64>()
        };
        let mean = (indexed.pixels.iter().zip(&many).map(off).sum::<f64>() / (3.0 * 4800.0)).sqrt();
        assert!(mean < 3.0, "{mean} of 255");
    }
}
