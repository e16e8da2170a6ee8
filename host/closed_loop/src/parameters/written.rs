//! Parameters as documents have them, by name.

use serde::Serializer;
use serde_json::json;

use super::Values;
use super::table::is_whole;
use crate::written::Written;

/// The value of a named parameter, as it is written.
pub fn written(name: &str, value: f64) -> Written {
    Written::new(value, is_whole(name))
}

/// Writes parameters by name. Read again, they are the same numbers.
///
/// # Errors
///
/// Errors of the serializer.
pub fn written_values<S: Serializer>(values: &Values, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(values.iter().map(|(name, &value)| (name, written(name, value))))
}

/// Parameters by name as JSON, as [`written_values`] writes them.
pub fn values_json(values: &Values) -> serde_json::Value {
    values.iter().map(|(name, &value)| (name.clone(), json!(written(name, value)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Serialize, serde::Deserialize)]
    struct Document(#[serde(serialize_with = "written_values")] Values);

    #[test]
    fn counts_and_choices_are_whole_lengths_are_not_and_all_read_back() {
        let values: Values = [
            ("lidar.denoise", 2.0),
            ("lidar.power", 75.0),
            ("lidar.upsampling", 4.0),
            ("registration.max_pair_distance_m", 2.0),
            ("registration.max_tuples", 1000.0),
            ("registration.normal_neighbours", 20.0),
            ("unheard.of", 3.0),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into();
        let text = serde_json::to_string(&Document(values.clone())).unwrap();
        let expected = r#"{"lidar.denoise":2,"lidar.power":75.0,"lidar.upsampling":4,"#.to_owned()
            + r#""registration.max_pair_distance_m":2.0,"registration.max_tuples":1000,"#
            + r#""registration.normal_neighbours":20,"unheard.of":3.0}"#;
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<Document>(&text).unwrap().0, values);
    }
}
