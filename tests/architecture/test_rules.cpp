// Each rule must find what it forbids and let the allowed neighbour pass.
#include <catch2/catch.hpp>

#include "tests/architecture/named_includes.hpp"
#include "tests/architecture/rules.hpp"

using namespace swiftlet::architecture;  // NOLINT(google-build-using-namespace)

namespace {

std::vector<Violation> flight(const std::string& text) {
  return checkFlightPath(parseSource("estimator/core/a.hpp", text));
}

std::vector<Violation> includes(const std::string& path, const std::string& target) {
  return checkIncludeDirections(parseSource(path, "#include \"" + target + "\"\n"));
}

}  // namespace

TEST_CASE("comments and literals are no code, line numbers stay") {
  const SourceFile file = parseSource("a.cpp",
                                      "int a; // throw\n"
                                      "/* new\n delete */ int b;\n"
                                      "auto s = \"throw \\\" new\"; char c = '\"';\n"
                                      "auto r = R\"x(throw)\" new)x\"; int d = 1'000'000;\n"
                                      "#include \"estimator/core/stamp.hpp\"\n"
                                      "// #include \"estimator/core/stamp.hpp\"\n");
  REQUIRE(file.code_lines.size() == 7);
  CHECK(checkFlightPath(file).empty());
  CHECK(file.code_lines[2].find("int b;") != std::string::npos);
  CHECK(file.code_lines[4].find("1'000'000") != std::string::npos);
  CHECK(file.code_lines[5].find("stamp.hpp") != std::string::npos);
  CHECK(file.code_lines[6].find("stamp.hpp") == std::string::npos);
}

TEST_CASE("rooms are folders of the table") {
  CHECK(parseSource("estimator/core/stamp.hpp", "").room() == "estimator/core");
  CHECK(parseSource("firmware_host/commands/replay.cpp", "").room() == "firmware_host/commands");
  CHECK(parseSource("firmware_host/lab/hil/hil_run.cpp", "").room() == "firmware_host/lab/hil");
  CHECK(parseSource("firmware_host/lab/calibrate/page/a.cpp", "").room() ==
        "firmware_host/lab/calibrate/page");
  CHECK(parseSource("mesher/plane.hpp", "").room() == "mesher");
  CHECK(parseSource("mapping/volume/block.hpp", "").room() == "mapping/volume");
}

TEST_CASE("locks are found by include and by name") {
  const auto locks = [](const std::string& text) {
    return checkNoLocks(parseSource("firmware_host/graph/a.cpp", text)).size();
  };
  CHECK(locks("#include <mutex>\n") == 1);
  CHECK(locks("std::scoped_lock guard(m);\n") == 1);
  CHECK(locks("std::mutex m;\n") == 1);
  CHECK(locks("pthread_cond_wait(&c, &m);\n") == 1);
  CHECK(locks("// a mutex\nstd::atomic<int> a;\n") == 0);
}

TEST_CASE("what a file names it includes, itself or through the project's headers") {
  const SourceFile header = parseSource("mesher/a.hpp", "#include <vector>\n");
  const auto check = [&](const std::string& text) {
    const SourceFile file = parseSource("mesher/a.cpp", text);
    return checkNamedIncludes(file, IncludeGraph({header, file})).size();
  };
  CHECK(check("std::vector<int> a;\nstd::vector<int> b;\n") == 1);
  CHECK(check("#include <vector>\nstd::vector<int> a;\n") == 0);
  CHECK(check("#include \"mesher/a.hpp\"\nstd::vector<int> a;\n") == 0);
  CHECK(check("#include \"mesher/a.hpp\"\nstd::span<int> a;\nEigen::Vector3d v;\n") == 2);
  CHECK(check("// std::vector\nother::std::vector a;\nmystd::vector b;\n") == 0);
}

TEST_CASE("include directions: forbidden, allowed and unknown") {
  const auto upward = includes("estimator/core/a.hpp", "estimator/geometry/so3.hpp");
  REQUIRE(upward.size() == 1);
  CHECK(upward[0].line == 1);
  CHECK(describe(upward).starts_with("estimator/core/a.hpp:1: estimator/core must not know"));

  CHECK(includes("estimator/odometry/a.cpp", "estimator/core/stamp.hpp").empty());
  CHECK(includes("mapping/surface/a.cpp", "mapping/volume/block.hpp").empty());
  CHECK(includes("drivers/recorded/a.cpp", "estimator/imu/imu_noise.hpp").empty());
  CHECK(includes("firmware_host/graph/a.cpp", "estimator/odometry/odometry.hpp").empty());
  CHECK(includes("firmware_host/lab/hil/a.cpp", "firmware_host/inputs/devices/b.hpp").empty());
  CHECK(includes("firmware_host/runs/a.cpp", "firmware_host/lab/hil/b.hpp").size() == 1);
  CHECK(includes("firmware_host/graph/a.cpp", "firmware_host/inputs/log/b.hpp").size() == 1);
  CHECK(includes("estimator/core/a.hpp", "firmware_host/realtime/b.hpp").size() == 1);

  CHECK(includes("estimator/frontend/a.cpp", "estimator/smoother/state.hpp").size() == 1);
  CHECK(includes("mapping/volume/a.cpp", "mapping/surface/a.hpp").size() == 1);
  CHECK(includes("mapping/volume/a.cpp", "mapping/depth/a.hpp").size() == 1);
  CHECK(includes("drivers/simulated/a.cpp", "estimator/frontend/pyramid.hpp").size() == 1);
  CHECK(includes("estimator/odometry/a.cpp", "firmware_host/settings/settings.hpp").size() == 1);
  CHECK(includes("estimator/core/a.hpp", "stamp.hpp").size() == 1);
  CHECK(includes("estimator/core/a.hpp", "tests/core/a.hpp").size() == 1);
  CHECK(includes("estimator/unheard_of/a.hpp", "estimator/core/stamp.hpp").size() == 1);
}

TEST_CASE("the flight path's forbidden words are found") {
  for (const char* bad :
       {"#include <mutex>", "#  include <condition_variable>", "#include <thread>", "#include <chrono>",
        "#include <fstream>", "#include <unordered_map>", "std::unordered_set<int> s;",
        "#include <opencv2/core.hpp>", "#include <random>", "throw 1;", "try {", "auto* p = new int[3];",
        "auto* p = new T(1);", "delete p;", "delete[] p;", "malloc(3);", "std::free (p);", "std::abort();"}) {
    INFO(bad);
    CHECK(flight(bad).size() == 1);
  }
  for (const char* good : {"Foo(const Foo&) = delete;", "auto* p = new (storage) T(1);", "int renewed = 0;",
                           "slots.free.pop();", "bool retry = true;", "double exit_time = 0;"}) {
    INFO(good);
    CHECK(flight(good).empty());
  }
}

TEST_CASE("headers open with the guard and a comment") {
  const auto opening = [](const char* text) { return checkHeaderOpening(parseSource("a.hpp", text)); };
  CHECK(opening("#pragma once\n// What it is.\n").empty());
  CHECK(opening("// What it is.\n#pragma once\n").size() == 1);
  CHECK(opening("#pragma once\n\n#include <array>\n").size() == 1);
  CHECK(opening("").size() == 1);
}

TEST_CASE("length, machine paths, unfinished work and unlisted sources are found") {
  CHECK(checkLength(parseSource("a.cpp", "1\n2\n3\n"), 3).empty());
  CHECK(checkLength(parseSource("a.cpp", "1\n2\n3\n4\n"), 3).size() == 1);

  const auto text = [](const std::string& line) { return checkText(parseSource("a.md", line + "\n")); };
  CHECK(text(std::string("see /ho") + "me/anna/log").size() == 1);
  CHECK(text(std::string("cd \"/wo") + "rk/swiftlet\"").size() == 1);
  CHECK(text(std::string("// TO") + "DO: later").size() == 1);
  CHECK(text(std::string("std::ran") + "ges::unique(edges)").size() == 1);
  CHECK(text("std::ranges::sort(edges)").empty());
  CHECK(text(std::string("build/release/ho") + "me/log and ../shared/wo" + "rk/data").empty());

  CHECK(checkNamedInList(parseSource("estimator/core/a.cpp", ""), "SOURCES a.cpp").empty());
  CHECK(checkNamedInList(parseSource("estimator/core/a.cpp", ""), "SOURCES b.cpp").size() == 1);
}
