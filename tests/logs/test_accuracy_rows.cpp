// The rules of the accuracy table: what counts as worse or lost, what it says without logs, and that the
// committed file survives a round.

#include <sys/wait.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/accuracy_rows.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

TEST_CASE("worse is more than the larger of 5 % and 0.3 mm") {
  CHECK_FALSE(isWorse(0.00529, 0.005));
  CHECK(isWorse(0.00531, 0.005));
  CHECK(isWorse(0.0067, 0.0047));  // which 2 mm allowed
  CHECK_FALSE(isWorse(0.1049, 0.1));
  CHECK(isWorse(0.1051, 0.1));
  CHECK_FALSE(isWorse(0.001, 0.1));
  CHECK(isWorse(std::nan(""), 0.1));
}

TEST_CASE("rows are compared with their own case, in both sections") {
  const std::vector<AccuracyRow> before = {{"a", 2, "odometry", 0.005, 0.004},
                                           {"a", 1, "odometry", 0.050, 0.040}};
  CHECK(findWorse(before, before).empty());
  CHECK(findWorse({{"a", 2, "odometry", 0.009, 0.004}}, before).size() == 1);
  CHECK(findWorse({{"a", 2, "odometry", 0.009, 0.009}}, before).size() == 2);
  CHECK(findWorse({{"a", 1, "odometry", 0.009, 0.009}}, before).empty());
  CHECK(findWorse({{"b", 2, "odometry", 9, 9}}, before).empty());  // not committed yet
}

TEST_CASE("a log too short for a figure has an empty field, and cannot get worse") {
  std::istringstream given("log,cameras,trajectory,all_m,from_3s_m\na,2,map,0.0050,\n");
  const std::vector<AccuracyRow> before = readAccuracyRows(given);
  REQUIRE(before.size() == 1);
  CHECK(before[0].all == 0.005);
  CHECK(std::isnan(before[0].from_3s));
  CHECK(findWorse(before, before).empty());
  CHECK(findWorse({{"a", 2, "map", 0.009, 0.1}}, before).size() == 1);
  std::ostringstream written;
  writeAccuracyRows(written, before);
  CHECK(written.str() == given.str());
  std::istringstream cut("a,2,map,0.0050\n");
  CHECK_THROWS_AS(readAccuracyRows(cut), std::runtime_error);
}

TEST_CASE("committed rows that are no longer produced are named") {
  const std::vector<AccuracyRow> before = {
      {"a", 2, "odometry", 1, 1}, {"a", 1, "map", 1, 1}, {"b", 2, "map", 1, 1}};
  CHECK(findLost(before, before).empty());
  CHECK(findLost({before[0], before[2], {"c", 2, "map", 1, 1}}, before) ==
        std::vector<std::string>{"a, 1 camera, map"});
  CHECK(findLost({}, before).size() == 3);
}

TEST_CASE("an update drops what a log no longer produces and keeps the rows of other logs") {
  const std::vector<AccuracyRow> before = {
      {"a", 2, "odometry", 1, 1}, {"a", 1, "map", 1, 1}, {"b", 2, "map", 1, 1}};
  const auto rows = updatedRows({{"a", 2, "odometry", 2, 2}, {"a", 2, "states", 3, 3}}, before);
  REQUIRE(rows.size() == 3);
  CHECK(rows[0].sameCase(before[0]));
  CHECK(rows[0].all == 2);
  CHECK(rows[1].sameCase(before[2]));
  CHECK(rows[2].trajectory == "states");
}

/// Exit code of accuracy_table in a folder without logs; what it prints goes to `said`.
int runWithoutLogs(const std::string& options, std::string& said) {
  const ScratchFolder folder("accuracy_table");
  const std::string command = "SWIFTLET_DATA='" + folder.path() + "' '" SWIFTLET_ACCURACY_TABLE "' " +
                              options + " >'" + folder.file("said") + "' 2>&1";
  const int status = std::system(command.c_str());
  said = test::textOf(folder.file("said"));
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_CASE("without logs the table fails and names logs and rows, whoever asks for it") {
  for (const char* options : {"", "--skip-without-logs"}) {  // the folder is named here: logs are expected
    std::string said;
    CHECK(runWithoutLogs(options, said) == 1);
    for (const char* log : {"euroc_mh01_20s", "euroc_v101_micro", "vil_v102", "vil_mh05"})
      CHECK_THAT(said, Catch::Contains("MISSING: log " + std::string(log)));
    CHECK_THAT(said, Catch::Contains("LOST: vil_mh05, 1 camera, map"));
  }
}

TEST_CASE("the file reads back; a damaged one names its line") {
  const std::vector<AccuracyRow> rows = {{"a", 2, "odometry", 0.0123, 0.0456}, {"b", 1, "map", 1, 0}};
  std::stringstream file;
  writeAccuracyRows(file, rows);
  const auto back = readAccuracyRows(file);
  REQUIRE(back.size() == 2);
  CHECK(back[0].sameCase(rows[0]));
  CHECK(back[0].all == Approx(0.0123));
  CHECK(back[1].from_3s == 0);
  std::istringstream damaged("log,cameras,trajectory,all_m,from_3s_m\na,2,odometry,x,1\n");
  CHECK_THROWS_WITH(readAccuracyRows(damaged), Catch::Contains("line 2"));
}

}  // namespace
}  // namespace swiftlet
