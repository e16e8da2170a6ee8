//! The world around the sensor.
