// `swiftlet pose-graph`, from the command line to its files.

#include <lzma.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "firmware_host/commands/program.hpp"
#include "firmware_host/lab/modules/g2o_file.hpp"
#include "firmware_host/lab/modules/pose_graph_run.hpp"
#include "mapping/pose_graph/pose_error.hpp"
#include "tests/firmware_host/run_program.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::messageOf;
using test::run;
using test::textOf;

void write(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// A closed walk around a square of 4 x `side` poses with ids 3, 6, 9, ...; no VERTEX lines, a little noise.
std::string squareWalk(int side) {
  std::string text;
  const int poses = 4 * side;
  const std::string information = " 100 0 0 100 0 1000\n";
  for (int k = 0; k < poses; ++k) {
    const double turn = k % side == side - 1 ? M_PI / 2 : 0;
    const double off = 0.01 * ((k * 7) % 5 - 2);
    text += "EDGE_SE2 " + std::to_string(3 * (k + 1)) + " " + std::to_string(3 * ((k + 1) % poses + 1)) +
            " " + std::to_string(1 + off) + " " + std::to_string(off) + " " +
            std::to_string(turn + 0.5 * off) + information;
  }
  return text;
}

std::string packed(const std::string& text) {
  std::string out(lzma_stream_buffer_bound(text.size()), '\0');
  std::size_t size = 0;
  REQUIRE(lzma_easy_buffer_encode(6, LZMA_CHECK_CRC64, nullptr,
                                  reinterpret_cast<const std::uint8_t*>(text.data()), text.size(),
                                  reinterpret_cast<std::uint8_t*>(out.data()), &size, out.size()) == LZMA_OK);
  out.resize(size);
  return out;
}

std::string complaint(const PoseGraphRequest& request) {
  return messageOf([&] { (void)runPoseGraph(request); });
}

TEST_CASE("pose-graph solves a file, keeps ids and edges, and writes the same bytes again") {
  const ScratchFolder folder("pose_graph");
  const std::string in = folder.file("in.g2o");
  const std::string out = folder.file("out.g2o");
  const std::string json = folder.file("out.json");
  write(in, squareWalk(10));
  REQUIRE(run({"pose-graph", in, "--out", out, "--json", json}) == kExitDone);
  const G2oFile before = readG2oFile(in);
  const G2oFile after = readG2oFile(out);
  CHECK(after.graph.ids == before.graph.ids);
  CHECK(after.graph.has_poses);
  REQUIRE(after.graph.edgeCount() == before.graph.edgeCount());
  for (std::size_t e = 0; e < after.graph.plane.edges.size(); ++e) {
    CHECK(after.graph.plane.edges[e].information == before.graph.plane.edges[e].information);
  }
  const auto figures = nlohmann::json::parse(textOf(json));
  CHECK(figures["poses"] == 40);
  CHECK(figures["edges"] == 40);
  CHECK(figures["converged"] == true);
  CHECK(figures["final_cost"].get<double>() < figures["start"]["given_cost"].get<double>());
  // The cost that it says is that of the file that it wrote.
  CHECK(graphCost(after.graph.plane) == Approx(figures["final_cost"].get<double>()).epsilon(1e-9));
  const std::string first = textOf(out);
  REQUIRE(run({"pose-graph", in, "--out", out}) == kExitDone);
  CHECK(textOf(out) == first);

  SECTION("a packed file is the same file, whatever its name") {
    write(folder.file("graph.bin"), packed(squareWalk(10)));
    REQUIRE(run({"pose-graph", folder.file("graph.bin"), "--out", out}) == kExitDone);
    CHECK(textOf(out) == first);
  }
  SECTION("solved already: nothing to gain") {
    PoseGraphRequest request;
    request.file = out;
    const PoseGraphResult result = runPoseGraph(request);
    CHECK(result.solve.final_cost == Approx(figures["final_cost"].get<double>()).epsilon(1e-6));
    CHECK(result.start.choice == StartChoice::kGiven);
  }
  SECTION("FIX is obeyed") {
    write(in, squareWalk(10) + "FIX 30\n");
    REQUIRE(run({"pose-graph", in, "--out", out}) == kExitDone);
    const G2oFile held = readG2oFile(out);
    REQUIRE(held.graph.fixed.size() == 1);
    const std::uint32_t pose = held.graph.fixed[0];
    CHECK(held.graph.ids[pose] == 30);
    const G2oFile given = readG2oFile(in);
    CHECK(held.graph.plane.poses[pose].translation == given.graph.plane.poses[pose].translation);
  }
}

TEST_CASE("false loops are added on request, the same for one seed") {
  const ScratchFolder folder("pose_graph_outliers");
  const std::string in = folder.file("in.g2o");
  write(in, squareWalk(10));
  const auto spoil = [&](const std::string& seed, const std::string& name) {
    REQUIRE(run({"pose-graph", in, "--inject-outliers", "12", "--seed", seed, "--iterations", "0", "--out",
                 folder.file(name)}) == kExitDone);
    return textOf(folder.file(name));
  };
  const std::string first = spoil("5", "a.g2o");
  CHECK(spoil("5", "b.g2o") == first);
  CHECK(spoil("6", "c.g2o") != first);
  CHECK(readG2oFile(folder.file("a.g2o")).graph.edgeCount() == 52);
  PoseGraphRequest request;
  request.file = folder.file("a.g2o");
  const double spoiled = runPoseGraph(request).solve.final_cost;
  request.file = in;
  CHECK(spoiled > 10 * runPoseGraph(request).solve.final_cost);
}

TEST_CASE("--robust leaves false loops out, says which, and writes the graph without them") {
  const ScratchFolder folder("pose_graph_robust");
  const std::string in = folder.file("in.g2o");
  const std::string out = folder.file("out.g2o");
  const std::string json = folder.file("out.json");
  const std::string csv = folder.file("loops.csv");
  // Twice around: pose 40 + k is where pose k was.
  std::string text;
  for (int k = 0; k < 80; ++k) {
    const double turn = k % 10 == 9 ? M_PI / 2 : 0;
    const double off = 0.002 * ((k * 7) % 5 - 2);
    if (k < 79) {
      text += "EDGE_SE2 " + std::to_string(3 * (k + 1)) + " " + std::to_string(3 * (k + 2)) + " " +
              std::to_string(1 + off) + " " + std::to_string(off) + " " + std::to_string(turn + 0.5 * off) +
              " 1e4 0 0 1e4 0 1e5\n";
    }
    if (k < 40) {
      text += "EDGE_SE2 " + std::to_string(3 * (k + 1)) + " " + std::to_string(3 * (k + 41)) + " " +
              std::to_string(off) + " " + std::to_string(-off) + " 0 1e4 0 0 1e4 0 1e5\n";
    }
  }
  write(in, text);
  REQUIRE(run({"pose-graph", in, "--robust", "--inject-outliers", "60", "--seed", "4", "--out", out, "--json",
               json, "--loops", csv}) == kExitDone);
  const auto figures = nlohmann::json::parse(textOf(json));
  CHECK(figures["edges"] == 179);
  CHECK(figures["robust"]["loops"] == 100);
  CHECK(figures["robust"]["own"]["selected"] == 40);
  CHECK(figures["robust"]["own"]["rejected"] == 0);
  CHECK(figures["robust"]["injected"]["rejected"] == 60);
  // Every loop with its ids; those of the file that are not selected are those that are not written.
  std::istringstream lines(textOf(csv));
  std::string line;
  std::getline(lines, line);
  CHECK(line == "edge,from_id,to_id,verdict,injected");
  int injected = 0;
  int selected = 0;
  for (int count = 0; std::getline(lines, line); ++count) {
    if (count == 0) CHECK(line.find(",3,123,selected,0") != std::string::npos);
    injected += line.ends_with(",1") ? 1 : 0;
    selected += line.find(",selected,") != std::string::npos ? 1 : 0;
  }
  CHECK(injected == 60);
  CHECK(selected == 40);
  CHECK(readG2oFile(out).graph.edgeCount() == 119);
  // The poses are those of the graph that was never spoiled.
  const std::string whole = folder.file("whole.g2o");
  REQUIRE(run({"pose-graph", in, "--out", whole}) == kExitDone);
  const G2oFile robust = readG2oFile(out);
  const G2oFile plain = readG2oFile(whole);
  for (std::size_t k = 0; k < 80; ++k) {
    CHECK((robust.graph.plane.poses[k].translation - plain.graph.plane.poses[k].translation).norm() < 1e-6);
  }
  const std::string spoiled = folder.file("spoiled.g2o");
  REQUIRE(run({"pose-graph", in, "--inject-outliers", "60", "--seed", "4", "--iterations", "0", "--out",
               spoiled}) == kExitDone);
  REQUIRE(run({"pose-graph", spoiled, "--robust", "--out", out}) == kExitDone);
  CHECK(readG2oFile(out).graph.edgeCount() == 119);

  PoseGraphRequest request;
  request.file = in;
  request.loops = csv;
  CHECK(complaint(request).find("--loops: no loop is rejected. Add --robust") != std::string::npos);
  request.robust = true;
  request.start = StartRule::kGiven;
  CHECK(complaint(request).find("--start") != std::string::npos);
  request.start = StartRule::kAuto;
  request.loops = folder.file("no/such/folder/loops.csv");
  CHECK(complaint(request).find("cannot be written") != std::string::npos);
}

TEST_CASE("bad graphs are named by file, line, field and remedy, and leave nothing behind") {
  const ScratchFolder folder("pose_graph_bad");
  PoseGraphRequest request;
  request.file = folder.file("bad.g2o");
  request.out = folder.file("out.g2o");
  write(request.file, squareWalk(2) + "EDGE_SE2 3 6 1 nan 0 1 0 0 1 0 1\n");
  CHECK(complaint(request).find("bad.g2o:9: dy: `nan` is not a finite number. Give") != std::string::npos);
  CHECK(run({"pose-graph", request.file, "--out", request.out}) == kExitBadInput);
  CHECK_FALSE(std::filesystem::exists(request.out));

  const std::string whole = packed(squareWalk(10));
  write(request.file, whole.substr(0, whole.size() / 2));
  CHECK(complaint(request).find("not a complete xz file") != std::string::npos);

  request.file = folder.file("nowhere.g2o");
  CHECK(complaint(request).find("cannot be read") != std::string::npos);
  request.file = folder.path();
  CHECK(complaint(request).find("cannot be read: Is a directory. Give a .g2o or .g2o.xz file") !=
        std::string::npos);

  request.file = folder.file("good.g2o");
  write(request.file, squareWalk(2));
  request.out = folder.file("no/such/folder/out.g2o");
  CHECK(complaint(request).find("cannot be written") != std::string::npos);
  request.out.clear();
  write(request.file, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n");
  request.outliers = 3;
  CHECK(complaint(request).find("--inject-outliers") != std::string::npos);
  CHECK(run({"pose-graph"}) == kExitBadInput);
  CHECK(run({"pose-graph", request.file, "--start", "elsewhere"}) == kExitBadInput);
}

TEST_CASE("--robust keeps fixed poses where the file has them") {
  const ScratchFolder folder("pose_graph_fixed");
  PoseGraphRequest request;
  request.file = folder.file("in.g2o");
  request.out = folder.file("out.g2o");
  request.robust = true;
  std::string walk;
  for (int k = 0; k < 10; ++k) {
    walk += "VERTEX_SE2 " + std::to_string(k) + " 5 " + std::to_string(k) + " 1.5\n";
    if (k > 0) {
      walk += "EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) + " 1.1 0 0 100 0 0 100 0 1000\n";
    }
  }
  write(request.file, walk + "FIX 4\nFIX 9\n");
  const PoseGraphResult result = runPoseGraph(request);
  CHECK(result.solve.converged);
  const PoseGraph<SE2> solved = readG2oFile(request.out).graph.plane;
  for (const std::size_t fixed : {4U, 9U}) {
    CHECK(solved.poses[fixed].translation.x() == 5);
    CHECK(solved.poses[fixed].translation.y() == static_cast<double>(fixed));
  }
  // The rest of the piece follows: backwards from the first fixed pose, spread between both.
  CHECK(std::abs(solved.poses[0].translation.y() - (4 - 4.4 * std::sin(1.5))) < 0.3);
  CHECK(solved.poses[6].translation.y() == Approx(6).margin(0.1));

  write(request.file, walk);
  const PoseGraphResult none = runPoseGraph(request);
  CHECK(none.solve.converged);
  CHECK(none.solve.final_cost < 1e-12);
}

TEST_CASE("a graph in pieces is solved piece by piece, with a warning") {
  const ScratchFolder folder("pose_graph_pieces");
  PoseGraphRequest request;
  request.file = folder.file("in.g2o");
  write(request.file, squareWalk(3) + "EDGE_SE2 1000 1001 1 2 0.3 1 0 0 1 0 1\n");
  const PoseGraphResult result = runPoseGraph(request);
  CHECK(result.pieces == 2);
  REQUIRE(result.warnings.size() == 1);
  CHECK(result.warnings[0].find("2 pieces") != std::string::npos);
  CHECK(result.factored);
}

}  // namespace
}  // namespace swiftlet
