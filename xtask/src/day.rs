//! Today's date.

use std::time::{SystemTime, UNIX_EPOCH};

use time::{Date, Duration, OffsetDateTime};

const SECONDS: u64 = 24 * 60 * 60;

/// The date in UTC, as 2026-11-21.
pub(crate) fn today() -> String {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    date((since.as_secs() / SECONDS) as i64)
}

/// The date that many days after 1970-01-01.
fn date(days: i64) -> String {
    let first = OffsetDateTime::UNIX_EPOCH.date();
    first.checked_add(Duration::days(days)).unwrap_or(Date::MAX).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_counted_over_leap_years() {
        let dates = [
            (0, "1970-01-01"),
            (58, "1970-02-28"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (11_017, "2000-03-01"),
            (19_782, "2024-02-29"),
            (20_453, "2025-12-31"),
            (20_454, "2026-01-01"),
            (20_778, "2026-11-21"),
            (47_540, "2100-02-28"),
            (47_541, "2100-03-01"),
        ];
        for (days, expected) in dates {
            assert_eq!(date(days), expected);
        }
    }
}
