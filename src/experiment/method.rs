//! Ways to render a scene that are compared with each other: a mode and, for yarns, a model.

use std::fmt;

use crate::scene::{Mode, Model};

/// A mode and, where one is named, a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Method {
    /// How yarns are represented.
    pub mode: Mode,
    /// The yarns' scattering model; `None` leaves it to the scene.
    pub model: Option<Model>,
}

impl Method {
    /// Reads "yarn", "yarn:two-stream" and the like.
    ///
    /// # Errors
    /// What is wrong with the text, and which names are known.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        fn named<T: Copy>(what: &str, name: &str, names: &[(&str, T)]) -> Result<T, String> {
            names.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
                let known: Vec<&str> = names.iter().map(|(known, _)| *known).collect();
                format!("unknown {what} `{name}`; known are {}", known.join(", "))
            })
        }
        let (mode, model) = text.split_once(':').map_or((text, None), |(mode, model)| (mode, Some(model)));
        Ok(Self {
            mode: named("mode", mode, &Mode::NAMES)?,
            model: model.map(|model| named("model", model, &Model::NAMES)).transpose()?,
        })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.mode.name())?;
        self.model.map_or(Ok(()), |model| write!(f, ":{}", model.name()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_read_as_they_are_written() {
        for text in ["yarn", "yarn:aggregated", "yarn:two-stream"] {
            assert_eq!(Method::parse(text).unwrap().to_string(), text);
        }
        assert_eq!(Method::parse("yarn").unwrap().model, None);
        assert!(Method::parse("cloth").unwrap_err().starts_with("unknown mode `cloth`; known are yarn"));
        assert!(Method::parse("yarn:magic").unwrap_err().starts_with("unknown model `magic`; known are aggregated"));
        assert!(Method::parse("").is_err());
    }
}
