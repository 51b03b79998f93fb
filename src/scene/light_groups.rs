//! Groups of lights, whose light an EXR holds in layers of their own.

/// The group of each light of a scene. Lights are told apart where at least one of them is in a group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightGroups {
    names: Vec<String>,
    /// Of each light: the place of its group among the names.
    of: Vec<u8>,
}

impl LightGroups {
    /// The most groups of a scene, with that of lights that are in none.
    pub const MOST: usize = 8;
    /// What lights that are in no group are called together, where others are in one.
    pub const OTHERS: &str = "others";

    /// From the group that is given for each light, if one is; `None` if they are more than [`Self::MOST`].
    pub fn new<'a>(given: impl IntoIterator<Item = Option<&'a str>>) -> Option<Self> {
        let given: Vec<Option<&str>> = given.into_iter().collect();
        if given.iter().all(Option::is_none) {
            return Some(Self::default());
        }
        let mut groups = Self::default();
        for name in given {
            let name = name.unwrap_or(Self::OTHERS);
            let place = groups.names.iter().position(|known| known == name).unwrap_or_else(|| {
                groups.names.push(name.to_owned());
                groups.names.len() - 1
            });
            groups.of.push(u8::try_from(place).ok()?);
        }
        (groups.names.len() <= Self::MOST).then_some(groups)
    }

    /// Their names, in the order in which lights have them; empty where lights are not told apart.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The place of a light's group among the names: 0 where lights are not told apart.
    #[inline]
    pub fn of(&self, light: usize) -> usize {
        self.of.get(light).copied().unwrap_or(0).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_without_a_group_are_one_where_others_have_one() {
        let groups = LightGroups::new([Some("key"), None, Some("rim"), Some("key")]).unwrap();
        assert_eq!(groups.names(), ["key", "others", "rim"]);
        assert_eq!([0, 1, 2, 3].map(|light| groups.of(light)), [0, 1, 2, 0]);
        assert_eq!(LightGroups::new([None, None]), Some(LightGroups::default()));
        let many: Vec<String> = (0..9).map(|i| format!("g{i}")).collect();
        assert!(LightGroups::new(many[..8].iter().map(|name| Some(name.as_str()))).is_some());
        assert_eq!(LightGroups::new(many.iter().map(|name| Some(name.as_str()))), None);
    }
}
