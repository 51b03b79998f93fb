//! Which prims of a stage are meant: paths with wildcards, or the material that is bound to them.

/// A choice of prims. `/Garment/Sleeve` is that prim and all below it; in a part of a path, `*` stands for any letters
/// and `?` for one; `material:/Looks/Wool*` chooses by the material bound. Several are parted by spaces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PrimPattern {
    paths: Vec<Vec<String>>,
    materials: Vec<Vec<String>>,
    all: bool,
}

impl PrimPattern {
    /// Every prim.
    pub fn all() -> Self {
        Self { all: true, ..Self::default() }
    }

    /// Reads a pattern.
    ///
    /// # Errors
    /// What is wrong with it: a path does not begin with `/`, or there is none.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut pattern = Self::default();
        for word in text.split_whitespace() {
            let (list, path) = match word.strip_prefix("material:") {
                Some(path) => (&mut pattern.materials, path),
                None => (&mut pattern.paths, word),
            };
            let Some(rest) = path.strip_prefix('/') else {
                return Err(format!("the path of a prim begins with /, found \"{word}\""));
            };
            let parts: Vec<String> = rest.split('/').filter(|part| !part.is_empty()).map(str::to_owned).collect();
            // The root itself is no prim: all are below it.
            pattern.all |= parts.is_empty();
            list.push(parts);
        }
        if pattern.paths.is_empty() && pattern.materials.is_empty() {
            return Err("a path of prims is expected, such as /Garment/*".to_owned());
        }
        Ok(pattern)
    }

    pub(super) fn matches(&self, path: &str) -> bool {
        self.all || self.paths.iter().any(|pattern| path_matches(pattern, path))
    }

    #[cfg_attr(not(feature = "usd"), allow(dead_code, reason = "Alembic has no materials"))]
    pub(super) fn names_materials(&self) -> bool {
        !self.materials.is_empty()
    }

    #[cfg_attr(not(feature = "usd"), allow(dead_code, reason = "Alembic has no materials"))]
    pub(super) fn matches_material(&self, path: &str) -> bool {
        self.materials.iter().any(|pattern| path_matches(pattern, path))
    }
}

/// Which meshes of a stage are meant, and by which of their texture coordinates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshChoice {
    /// The meshes.
    pub prims: PrimPattern,
    /// Name of a set of texture coordinates, without `primvars:`; the usual one if absent.
    pub uv: Option<String>,
}

impl MeshChoice {
    /// Every mesh, by its usual texture coordinates.
    pub fn all() -> Self {
        Self { prims: PrimPattern::all(), uv: None }
    }
}

/// Whether a path is one that the pattern means; what lies below it is chosen on the way down.
fn path_matches(pattern: &[String], path: &str) -> bool {
    let parts: Vec<&str> = path.split('/').filter(|part| !part.is_empty()).collect();
    parts.len() == pattern.len() && pattern.iter().zip(parts).all(|(p, part)| glob(p, part))
}

/// Whether a name is what a pattern says, with `*` for any letters and `?` for one.
pub(crate) fn glob(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n) = (0, 0);
    // The star before here, and from where on the name is what follows it.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => {
                let Some((at, from)) = star else { return false };
                star = Some((at, from + 1));
                p = at + 1;
                n = from + 1;
            }
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_choose_by_path_and_material() {
        let pattern = PrimPattern::parse("/Garment/rib_* /Body material:/Looks/W?ol").unwrap();
        assert!(pattern.matches("/Garment/rib_hem") && pattern.matches("/Body"));
        assert!(
            !pattern.matches("/Garment") && !pattern.matches("/Garment/rib_hem/front") && !pattern.matches("/body")
        );
        assert!(pattern.matches_material("/Looks/Wool") && !pattern.matches_material("/Looks/Woool"));
        assert!(PrimPattern::all().matches("/any/where"));
    }

    #[test]
    fn stars_stand_for_any_letters() {
        for (pattern, text, want) in [
            ("*", "", true),
            ("a*b*c", "aXbYbZc", true),
            ("a*b", "ab", true),
            ("a*b", "abc", false),
            ("rib_*", "ribs", false),
            ("front", "front2", false),
            ("*a*b", "xaxbxb", true),
            ("??", "ab", true),
            ("?", "", false),
            ("**x", "yyx", true),
            ("?rmel_*", "Ärmel_links", true),
        ] {
            assert_eq!(glob(pattern, text), want, "{pattern} {text}");
        }
    }

    #[test]
    fn mistakes_are_named() {
        assert!(PrimPattern::parse("Garment").unwrap_err().contains("begins with /"));
        assert!(PrimPattern::parse("  ").is_err());
    }
}
