// Positions without attitude: local ones, geodetic ones, and what is no such file.

#include <catch2/catch.hpp>
#include <cmath>

#include "drivers/recorded/position_file.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

std::vector<PositionPoint> read(const std::string& text) {
  LogCounters counters;
  LogWarnings warnings;
  return readPositionsText("positions", text, counters, warnings);
}

TEST_CASE("local positions, by commas or blanks, in seconds or nanoseconds", "[positions]") {
  const auto commas = read("#t [s],east [m],north [m],up [m],v_east [m/s]\n0.25,1,2,3,9\n0.5,4,5,6,9\n");
  REQUIRE(commas.size() == 2);
  CHECK(commas[0].stamp.ns == 250000000);
  CHECK(commas[1].p == Eigen::Vector3d(4, 5, 6));
  const auto blanks = read("1403636579763555584 1 2 3\n1403636579863555584 1.5 2 3\n");
  REQUIRE(blanks.size() == 2);
  CHECK(blanks[1].stamp.ns == 1403636579863555584);
  CHECK(read("1403636579.763555584, 1, 2, 3\n")[0].stamp.ns == 1403636579763555584);
}

TEST_CASE("geodetic positions become metres east, north and up", "[positions]") {
  const auto points = read(
      "time,satellites,Latitude (deg),Longitude (deg),Altitude [m]\n"
      "10.0,9,47.3977,8.5456,488\n11.0,,47.3987,8.5456,489\n12.0,9,47.3977,8.5466,488\n");
  REQUIRE(points.size() == 3);
  CHECK(points[0].p.norm() < 1e-6);
  // Radii of curvature of WGS 84 at this latitude: 6 370 154 m along the meridian, 6 389 740 m across.
  const double degree = 3.14159265358979 / 180;
  CHECK(points[1].p.y() == Approx(0.001 * degree * (6370154.0 + 488.5)).margin(2e-3));
  CHECK(points[1].p.x() == Approx(0).margin(1e-6));
  CHECK(points[1].p.z() == Approx(1).margin(2e-3));
  CHECK(points[2].p.x() ==
        Approx(0.001 * degree * (6389740.0 + 488) * std::cos(47.3977 * degree)).margin(2e-3));
}

TEST_CASE("what is no position is named", "[positions]") {
  const auto message = [](const std::string& text) { return test::messageOf([&] { (void)read(text); }); };
  CHECK(message("1.0,2,3\n2.0,2,3\n").find("positions:1: row: ") != std::string::npos);
  CHECK(message("t,lat,lon,alt\n1.0,472,8,0\n").find("latitude: is beyond 90 degrees") != std::string::npos);
  CHECK(message("1.0,a,2,3\n").find("`a` is not a number") != std::string::npos);
  CHECK(!message("").empty());
}

}  // namespace
}  // namespace swiftlet
