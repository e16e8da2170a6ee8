//! The `[lidar]` section: the firmware's parameter table in its units.

use std::fmt;

use echoloop_dsp::{Hardware, Kind, PARAMETERS, Parameter, ParameterId, Refusal, Settings};
use serde::de::{DeserializeSeed, Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Θ_lidar as written in a file: names and units of [`PARAMETERS`], choices by name.
///
/// A parameter that is left out has its default. Each value is checked while it is read, so an
/// error points at it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lidar(pub Settings);

impl Lidar {
    /// Checks the joint constraints, which no single value can break.
    ///
    /// # Errors
    ///
    /// [`Refusal`], as the sensor would answer.
    pub fn check(&self, hardware: &Hardware) -> Result<(), Refusal> {
        self.0.check(hardware)
    }
}

impl Serialize for Lidar {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for parameter in &PARAMETERS {
            let Some(code) = self.0.get(parameter.id) else { continue };
            match parameter.kind {
                Kind::Choice { names, .. } => {
                    map.serialize_entry(parameter.name, names.get(code as usize).unwrap_or(&"?"))?;
                }
                Kind::Integer | Kind::PowerOfTwo => map.serialize_entry(parameter.name, &code)?,
                Kind::Real { .. } => {
                    map.serialize_entry(parameter.name, &parameter.to_unit(code))?
                }
            }
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Lidar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(LidarVisitor)
    }
}

struct LidarVisitor;

impl<'de> Visitor<'de> for LidarVisitor {
    type Value = Lidar;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of sensor parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Lidar, A::Error> {
        let mut settings = Settings::default();
        while let Some(Name(id)) = map.next_key()? {
            settings.set(id, Some(map.next_value_seed(Code(id))?));
        }
        Ok(Lidar(settings))
    }
}

/// A parameter's name.
struct Name(ParameterId);

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const NAMES: [&str; PARAMETERS.len()] = {
            let mut names = [""; PARAMETERS.len()];
            let mut i = 0;
            while i < names.len() {
                names[i] = PARAMETERS[i].name;
                i += 1;
            }
            names
        };
        let name = String::deserialize(deserializer)?;
        ParameterId::by_name(&name).map(Name).ok_or_else(|| D::Error::unknown_field(&name, &NAMES))
    }
}

/// A parameter's value, as its wire code.
struct Code(ParameterId);

impl<'de> DeserializeSeed<'de> for Code {
    type Value = i32;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<i32, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl Code {
    fn checked<E: Error>(&self, code: i32) -> Result<i32, E> {
        self.0.check(code).map(|()| code).map_err(E::custom)
    }
}

impl Visitor<'_> for Code {
    type Value = i32;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Parameter { kind, unit, .. } = self.0.parameter();
        match kind {
            Kind::Choice { names, .. } => write!(f, "one of {names:?}"),
            _ if unit.is_empty() => f.write_str("a number"),
            _ => write!(f, "a number ({unit})"),
        }
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<i32, E> {
        let parameter = self.0.parameter();
        if matches!(parameter.kind, Kind::Choice { .. }) {
            return Err(E::invalid_type(serde::de::Unexpected::Float(value), &self));
        }
        if !value.is_finite() {
            return Err(E::custom(format_args!("{} must be finite, not {value}", parameter.name)));
        }
        if matches!(parameter.kind, Kind::Integer | Kind::PowerOfTwo) && value.fract() != 0.0 {
            return Err(E::custom(format_args!(
                "{} must be a whole number, not {value}",
                parameter.name
            )));
        }
        self.checked(parameter.to_code(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<i32, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<i32, E> {
        self.visit_f64(value as f64)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<i32, E> {
        let index = match self.0.parameter().kind {
            Kind::Choice { names, .. } => names.iter().position(|name| *name == value),
            _ => None,
        };
        match index {
            Some(index) => self.checked(index as i32),
            None => Err(E::invalid_value(serde::de::Unexpected::Str(value), &self)),
        }
    }
}
