//! The command, its pages and the boards it talks to, as one program: cargo links each it is given
//! with everything we have, which took longer than most of these tests. One file alone:
//! `cargo test -p echoloop-app --test command qemu::`.

#[cfg(unix)]
mod board;
#[cfg(unix)]
mod board_log;
mod browser;
mod cli;
mod clouds;
mod desk;
mod echoes;
mod figures;
mod fixture;
mod folders;
mod goals;
#[cfg(unix)]
mod host_front_end;
#[cfg(unix)]
mod hostile;
mod leak;
mod methods;
mod odd_clouds;
mod pairs;
mod patterns;
#[cfg(unix)]
mod qemu;
mod real_clouds;
mod recording;
mod report;
mod reproduce;
mod roads;
mod scene;
#[cfg(unix)]
mod serial;
mod sets;
mod survey;
mod svg;
mod told;
mod trajectory;
