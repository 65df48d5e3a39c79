//! What install.sh puts in place is found by pkg-config and CMake, wherever it is moved to, and nothing but the interface is exported.

use std::fs;
use std::process::Command;

use crate::installed::{folder, is_there, package, prefix, run};

fn words(printed: &str) -> Vec<&str> {
    printed.split_whitespace().collect()
}

fn pkg_config(arguments: &[&str]) -> String {
    let mut command = Command::new("pkg-config");
    run(command
        .env("PKG_CONFIG_PATH", prefix().join("lib/pkgconfig"))
        .args(arguments))
}

#[test]
fn by_pkg_config() {
    if !is_there("pkg-config", "linpred.pc") || !is_there("cc", "linpred.pc") {
        return;
    }
    assert_eq!(
        pkg_config(&["--modversion", "linpred"]).trim(),
        env!("CARGO_PKG_VERSION")
    );
    let program = folder("pkg-config").join("program");
    let flags = pkg_config(&["--cflags", "--libs", "linpred"]);
    let mut cc = Command::new("cc");
    cc.arg(package().join("examples/rows.c"))
        .args(words(&flags))
        .arg("-o")
        .arg(&program);
    run(&mut cc);
    run(Command::new(program)
        .env("LD_LIBRARY_PATH", prefix().join("lib"))
        .env("DYLD_LIBRARY_PATH", prefix().join("lib")));
    let all = pkg_config(&["--static", "--libs", "linpred"]);
    assert!(words(&all).contains(&"-lm"), "{all}");
}

#[test]
fn by_cmake_and_after_a_move() {
    if !is_there("cmake", "linpredConfig.cmake") {
        return;
    }
    let folder = folder("cmake");
    let moved = folder.join("elsewhere");
    run(Command::new("cp").arg("-R").arg(prefix()).arg(&moved));
    let example = package().join("examples");
    let project = format!(
        "cmake_minimum_required(VERSION 3.16)
project(host C CXX)
find_package(linpred {} REQUIRED)
foreach(kind linpred static)
  add_executable(frame_${{kind}} \"{1}/frame.c\")
  target_link_libraries(frame_${{kind}} PRIVATE linpred::${{kind}})
  add_executable(frame_cpp_${{kind}} \"{1}/frame.cpp\")
  target_link_libraries(frame_cpp_${{kind}} PRIVATE linpred::${{kind}})
endforeach()
",
        env!("CARGO_PKG_VERSION"),
        example.display()
    );
    fs::write(folder.join("CMakeLists.txt"), project).unwrap();
    let built = folder.join("built");
    let mut cmake = Command::new("cmake");
    let prefix_path = format!("-DCMAKE_PREFIX_PATH={}", moved.display());
    run(cmake
        .arg("-S")
        .arg(&folder)
        .arg("-B")
        .arg(&built)
        .arg(prefix_path));
    run(Command::new("cmake").arg("--build").arg(&built));
    let programs = [
        "frame_linpred",
        "frame_cpp_linpred",
        "frame_static",
        "frame_cpp_static",
    ];
    let printed = programs.map(|program| run(&mut Command::new(built.join(program))));
    assert!(
        printed
            .iter()
            .all(|sum| *sum == printed[0] && sum.len() == 17),
        "{printed:?}"
    );

    let newer = "cmake_minimum_required(VERSION 3.16)\nproject(host C)\nfind_package(linpred 0.999 REQUIRED)\n";
    fs::write(folder.join("CMakeLists.txt"), newer).unwrap();
    let prefix_path = format!("-DCMAKE_PREFIX_PATH={}", moved.display());
    let refused = Command::new("cmake")
        .arg("-S")
        .arg(&folder)
        .arg("-B")
        .arg(folder.join("newer"))
        .arg(prefix_path)
        .output();
    assert!(
        !refused.unwrap().status.success(),
        "a version that is not there was found"
    );
}

#[test]
fn and_nothing_but_the_interface_is_exported() {
    let library = prefix().join("lib/liblinpred_c.so");
    if !library.exists() || !is_there("nm", "exported names") {
        return;
    }
    let names = run(Command::new("nm")
        .args(["--dynamic", "--defined-only", "--format=posix"])
        .arg(library));
    let header = fs::read_to_string(prefix().join("include/linpred.h")).unwrap();
    let names: Vec<&str> = names
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert!(names.len() >= 18, "{names:?}");
    for name in names {
        assert!(
            header.contains(&format!("{name}(")),
            "{name} is exported, and not in linpred.h"
        );
    }
}
