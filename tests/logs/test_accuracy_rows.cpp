// The rule of the accuracy table: what counts as worse, and that the committed file survives a round.

#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

#include "tests/logs/accuracy_rows.hpp"

namespace swiftlet {
namespace {

TEST_CASE("worse is more than the larger of 10 % and 2 mm") {
  CHECK_FALSE(isWorse(0.0069, 0.005));  // 1.9 mm
  CHECK(isWorse(0.0071, 0.005));
  CHECK_FALSE(isWorse(0.109, 0.1));  // 9 %
  CHECK(isWorse(0.111, 0.1));
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
