//! Values of attributes as plain numbers, whatever precision they were written in.

use glam::{DQuat, DVec2, DVec3};
use openusd::{
    sdf::Value,
    usd::{Prim, TimeCode},
};

use crate::files::stage::{Problem, curves::Spread};

/// The attributes of a prim at one time.
pub(super) struct Values<'a> {
    pub(super) prim: &'a Prim,
    pub(super) time: TimeCode,
}

impl Values<'_> {
    pub(super) fn value(&self, name: &str) -> Result<Option<Value>, Problem> {
        let value = self.prim.attribute(name).get_at::<Value>(self.time)?;
        Ok(value.filter(|v| !matches!(v, Value::ValueBlock | Value::None)))
    }

    fn typed<T>(&self, name: &str, kind: &str, read: impl FnOnce(Value) -> Option<T>) -> Result<Option<T>, Problem> {
        let Some(value) = self.value(name)? else { return Ok(None) };
        let found: &'static str = (&value).into();
        match read(value) {
            Some(value) => Ok(Some(value)),
            None => Err(Problem::new(format!("`{name}` should be {kind}, found {found}"))),
        }
    }

    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, Problem> {
        self.typed(name, "a number", |v| number(&v))
    }

    pub(super) fn token(&self, name: &str) -> Result<Option<String>, Problem> {
        self.typed(name, "a token", |v| token(&v))
    }

    pub(super) fn tokens(&self, name: &str) -> Result<Option<Vec<String>>, Problem> {
        self.typed(name, "tokens", |v| match v {
            Value::TokenVec(list) => Some(list.iter().map(|t| t.as_str().to_owned()).collect()),
            v => empty(&v),
        })
    }

    pub(super) fn integers(&self, name: &str) -> Result<Option<Vec<i64>>, Problem> {
        self.typed(name, "a list of integers", |v| {
            Some(match v {
                Value::IntVec(v) => v.into_iter().map(i64::from).collect(),
                Value::UintVec(v) => v.into_iter().map(i64::from).collect(),
                Value::Int64Vec(v) => v,
                _ => return empty(&v),
            })
        })
    }

    pub(super) fn numbers(&self, name: &str) -> Result<Option<Vec<f64>>, Problem> {
        self.typed(name, "a list of numbers", |v| {
            Some(match v {
                Value::FloatVec(v) => v.into_iter().map(f64::from).collect(),
                Value::DoubleVec(v) => v,
                Value::HalfVec(v) => v.into_iter().map(|x| f64::from(x.to_f32())).collect(),
                _ => return empty(&v),
            })
        })
    }

    pub(super) fn pairs(&self, name: &str) -> Result<Option<Vec<DVec2>>, Problem> {
        self.typed(name, "a list of pairs", |v| {
            Some(match v {
                Value::Vec2fVec(v) => v.into_iter().map(|p| DVec2::new(p.x.into(), p.y.into())).collect(),
                Value::Vec2dVec(v) => v.into_iter().map(|p| DVec2::new(p.x, p.y)).collect(),
                Value::Vec2hVec(v) => {
                    v.into_iter().map(|p| DVec2::new(p.x.to_f32().into(), p.y.to_f32().into())).collect()
                }
                _ => return empty(&v),
            })
        })
    }

    pub(super) fn vectors(&self, name: &str) -> Result<Option<Vec<DVec3>>, Problem> {
        self.typed(name, "a list of triples", |v| {
            Some(match v {
                Value::Vec3fVec(v) => v.into_iter().map(|p| DVec3::new(p.x.into(), p.y.into(), p.z.into())).collect(),
                Value::Vec3dVec(v) => v.into_iter().map(|p| DVec3::new(p.x, p.y, p.z)).collect(),
                Value::Vec3hVec(v) => v
                    .into_iter()
                    .map(|p| DVec3::new(p.x.to_f32().into(), p.y.to_f32().into(), p.z.to_f32().into()))
                    .collect(),
                _ => return empty(&v),
            })
        })
    }

    /// The points of curves or of a mesh. Where they have velocities (in units a second), they go on by these from the last sample
    /// before the time, so that what changes from sample to sample moves as well.
    pub(super) fn points(&self) -> Result<Vec<DVec3>, Problem> {
        let between = || Ok(self.vectors("points")?.unwrap_or_default());
        if self.time.is_earliest_time() || self.value("velocities")?.is_none() {
            return between();
        }
        let (time, samples) = (self.time.value(), self.prim.attribute("points").time_sample_times()?);
        // Times that were rounded are meant.
        let last = samples.partition_point(|sample| *sample <= time + 1e-6).max(1);
        let Some(&sample) = samples.get(last - 1) else { return between() };
        let there = Values { prim: self.prim, time: TimeCode::new(sample) };
        let (points, velocities) = (there.vectors("points")?, there.vectors("velocities")?.unwrap_or_default());
        match points.filter(|points| points.len() == velocities.len()) {
            Some(points) => {
                let seconds = (time - sample) / self.prim.stage().time_codes_per_second();
                Ok(points.iter().zip(velocities).map(|(p, v)| *p + v * seconds).collect())
            }
            None => between(),
        }
    }

    pub(super) fn rotations(&self, name: &str) -> Result<Option<Vec<DQuat>>, Problem> {
        let turn = |x: f64, y: f64, z: f64, w: f64| DQuat::from_xyzw(x, y, z, w);
        let unit = |q: DQuat| if q.length_squared() > 1e-12 { q.normalize() } else { DQuat::IDENTITY };
        self.typed(name, "a list of quaternions", |v| {
            let turns: Vec<DQuat> = match v {
                Value::QuatfVec(v) => {
                    v.into_iter().map(|q| turn(q.x.into(), q.y.into(), q.z.into(), q.w.into())).collect()
                }
                Value::QuathVec(v) => {
                    let wide = |h: openusd::gf::f16| f64::from(h.to_f32());
                    v.into_iter().map(|q| turn(wide(q.x), wide(q.y), wide(q.z), wide(q.w))).collect()
                }
                Value::QuatdVec(v) => v.into_iter().map(|q| turn(q.x, q.y, q.z, q.w)).collect(),
                _ => return empty(&v),
            };
            Some(turns.into_iter().map(unit).collect())
        })
    }

    /// A primvar and how its values are spread (`otherwise` where it does not say): without its indices, and that of the
    /// nearest prim above where this one has none and that one's is constant.
    pub(super) fn primvar<T: Copy>(
        &self,
        name: &str,
        read: impl for<'b> Fn(&Values<'b>, &str) -> Result<Option<Vec<T>>, Problem>,
        otherwise: Spread,
    ) -> Result<Option<(Vec<T>, Spread)>, Problem> {
        let name = format!("primvars:{name}");
        if let Some(values) = read(self, &name)? {
            let spread = self.spread(&name, otherwise)?;
            let Some(indices) = self.integers(&format!("{name}:indices"))? else { return Ok(Some((values, spread))) };
            let known = |&index: &i64| usize::try_from(index).ok().and_then(|i| values.get(i)).copied();
            let given = indices.iter().map(known).collect::<Option<Vec<T>>>();
            let wrong = || Problem::new(format!("`{name}:indices` names none of {} values", values.len()));
            return Ok(Some((given.ok_or_else(wrong)?, spread)));
        }
        let mut above = self.prim.path().parent();
        while let Some(path) = above.filter(|path| !path.is_abs_root()) {
            let prim = self.prim.stage().prim(path.clone());
            let own = Values { prim: &prim, time: self.time };
            if let Some(values) = read(&own, &name)? {
                let constant = own.spread(&name, Spread::Constant)? == Spread::Constant;
                return Ok(constant.then_some((values, Spread::Constant)));
            }
            above = path.parent();
        }
        Ok(None)
    }

    /// How a primvar's values are spread; `otherwise` where it does not say.
    pub(super) fn spread(&self, name: &str, otherwise: Spread) -> Result<Spread, Problem> {
        let written = self.prim.attribute(name).get_metadata::<Value>("interpolation")?.as_ref().and_then(token);
        match written.as_deref() {
            None => Ok(otherwise),
            Some("constant") => Ok(Spread::Constant),
            Some("uniform") => Ok(Spread::Uniform),
            Some("varying") => Ok(Spread::Varying),
            Some("vertex") => Ok(Spread::Vertex),
            Some("faceVarying") => Ok(Spread::FaceVarying),
            Some(other) => Err(Problem::new(format!("`{name}` has an unknown interpolation, \"{other}\""))),
        }
    }
}

/// An empty list has lost its type in some writers.
fn empty<T>(value: &Value) -> Option<Vec<T>> {
    matches!(value, Value::ValueVec(v) if v.is_empty()).then(Vec::new)
}

pub(super) fn number(value: &Value) -> Option<f64> {
    Some(match value {
        Value::Double(x) => *x,
        Value::Float(x) => f64::from(*x),
        Value::Half(x) => f64::from(x.to_f32()),
        Value::Int(x) => f64::from(*x),
        Value::Int64(x) => *x as f64,
        _ => return None,
    })
}

pub(super) fn token(value: &Value) -> Option<String> {
    match value {
        Value::Token(t) => Some(t.as_str().to_owned()),
        Value::String(s) => Some(s.clone()),
        _ => None,
    }
}
