#include <limits>

#include "drivers/recorded/imu_file.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::contains;
using test::errorOf;

constexpr const char* kImuHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y "
    "[m "
    "s^-2],a_RS_S_z [m s^-2]\n";

std::string rows(int first, int last) {
  std::string text;
  for (int i = first; i < last; ++i)
    text += std::to_string(1000 + 5 * i) + "000000,0.1,-0.2,0.3,9.7,0.5,-1.25\n";
  return text;
}

struct ReadImu {
  LogCounters counters;
  LogWarnings warnings;
  std::vector<ImuSample> samples;
  explicit ReadImu(const std::string& text) { samples = readImuText("imu.csv", text, counters, warnings); }
};

TEST_CASE("gyro comes first; stamps are exact", "[imu_file]") {
  const ReadImu read(std::string(kImuHeader) +
                     "1403636579758555392,-0.0992,0.1473,0.0293,8.1447,-0.3759,-2.4026\n");
  REQUIRE(read.samples.size() == 1);
  CHECK(read.samples[0].stamp.ns == 1403636579758555392);
  CHECK(read.samples[0].gyro == Eigen::Vector3d(-0.0992, 0.1473, 0.0293));
  CHECK(read.samples[0].accel == Eigen::Vector3d(8.1447, -0.3759, -2.4026));
  CHECK(read.warnings.lines().empty());
}

TEST_CASE("copies that vary in blanks, line ends and headers read the same", "[imu_file]") {
  const ReadImu reference(kImuHeader + rows(0, 20));
  std::string text = kImuHeader + rows(0, 20);
  SECTION("no header") { text = rows(0, 20); }
  SECTION("header without #") { text = std::string(kImuHeader).substr(1) + rows(0, 20); }
  SECTION("byte order mark") { text = "\xEF\xBB\xBF" + text; }
  SECTION("no end of line at the end") { text.pop_back(); }
  SECTION("blank lines and comments") { text = "\n# a comment\n" + text + "\n\n# end\n"; }
  SECTION("CRLF and blanks") {
    std::string other;
    for (const char c : text) other += c == '\n' ? " \r\n" : c == ',' ? ", \t" : std::string(1, c);
    text = other;
  }
  SECTION("more columns") {
    std::string other;
    for (const char c : text) other += c == '\n' ? ",25.0\n" : std::string(1, c);
    text = other;
  }
  const ReadImu read(text);
  REQUIRE(read.samples.size() == 20);
  for (std::size_t i = 0; i < 20; ++i) {
    CHECK(read.samples[i].stamp == reference.samples[i].stamp);
    CHECK(read.samples[i].accel == reference.samples[i].accel);
  }
  CHECK(read.counters.bad_rows == 0);
}

TEST_CASE("rows out of order are sorted, repeated stamps dropped, both counted", "[imu_file]") {
  const ReadImu read(kImuHeader + rows(0, 5) + rows(7, 10) + rows(5, 7) + rows(9, 20));
  REQUIRE(read.samples.size() == 20);
  for (std::size_t i = 1; i < 20; ++i) CHECK(read.samples[i - 1].stamp < read.samples[i].stamp);
  CHECK(read.counters.out_of_order == 2);
  CHECK(read.counters.repeated_stamps == 1);
  CHECK(anyContains(read.warnings.lines(), "2 rows out of order"));
  CHECK(anyContains(read.warnings.lines(), "1 rows repeat a stamp"));
}

TEST_CASE("a row with text is skipped, counted and named", "[imu_file]") {
  const ReadImu read(kImuHeader + rows(0, 3) + "1015000000,0.1,oops,0.3,9.7,0.5,-1.25\n" + rows(4, 20));
  CHECK(read.samples.size() == 19);
  CHECK(read.counters.bad_rows == 1);
  REQUIRE(read.warnings.lines().size() == 1);
  CHECK(contains(read.warnings.lines()[0], "imu.csv:5: gyro y: `oops` is not a number, row skipped"));
}

TEST_CASE("NaN, short, long and binary rows are skipped and counted", "[imu_file]") {
  const std::string binary("\x00\x01\xff,1,2,3,4,5,6\n", 16);
  const ReadImu read(kImuHeader + rows(0, 30) + "1150000000,0.1,nan,0.3,9.7,0.5,-1.25\n" +
                     "1155000000,0.1,0.2\n" + "1160000000," + std::string(5000, '1') + "\n" + binary +
                     rows(34, 60));
  CHECK(read.samples.size() == 56);
  CHECK(read.counters.nan_rows == 1);
  CHECK(read.counters.bad_rows == 3);
  CHECK(anyContains(read.warnings.lines(), "imu.csv:32: gyro y: `nan`"));
  CHECK(anyContains(read.warnings.lines(), "3 fields where 7 are expected"));
  CHECK(anyContains(read.warnings.lines(), "imu.csv:34: row: the line is longer"));
}

TEST_CASE("many bad rows show only the first few lines", "[imu_file]") {
  std::string text = kImuHeader + rows(0, 200);
  for (int i = 0; i < 15; ++i) text += "x\n";
  const ReadImu read(text);
  CHECK(read.counters.bad_rows == 15);
  CHECK(read.warnings.lines().size() == LogWarnings::kPerKind);
  CHECK(contains(read.warnings.lines().back(), "of this kind are only counted"));
}

TEST_CASE("a file of another kind is refused with its first bad line", "[imu_file]") {
  const InputError mixed = errorOf([] { ReadImu(kImuHeader + rows(0, 5) + "a,b\nc,d\ne,f\ng,h\n"); });
  CHECK(mixed.line == 7);
  CHECK(contains(mixed.message, "4 of 9 rows"));
  CHECK(contains(errorOf([] { ReadImu(""); }).message, "no IMU samples"));
  CHECK(contains(errorOf([] { ReadImu{kImuHeader}; }).message, "no IMU samples"));
  const InputError trajectory = errorOf([] { ReadImu("1.0 0 0 0 0 0 0 1\n2.0 0 0 0 0 0 0 1\n"); });
  CHECK(trajectory.line == 1);
  CHECK(contains(errorOf([] { ReadImu("1,nan,0,0,0,0,9.8\n"); }).message, "not finite"));
}

TEST_CASE("more than a tenth of NaN rows is refused", "[imu_file]") {
  std::string text = kImuHeader + rows(0, 30);
  for (int i = 30; i < 34; ++i) text += std::to_string(1000 + 5 * i) + "000000,0.1,nan,0.3,9.7,0.5,-1.25\n";
  const InputError error = errorOf([&] { ReadImu{text}; });
  CHECK(error.line == 32);
  CHECK(contains(error.message, "4 of 34 rows"));
}

TEST_CASE("a stamp at the end of the range is a bad row", "[imu_file]") {
  const ReadImu read(kImuHeader + rows(0, 20) + "9223372036854775807,0.1,-0.2,0.3,9.7,0.5,-1.25\n" +
                     "-9223372036854775808,0.1,-0.2,0.3,9.7,0.5,-1.25\n" + rows(20, 40));
  CHECK(read.samples.size() == 40);
  CHECK(read.counters.bad_rows == 2);
  // Of live samples too.
  std::vector<ImuSample> samples(3);
  for (ImuSample& sample : samples) sample.accel = {0, 0, 9.81};
  samples[2].stamp.ns = std::numeric_limits<std::int64_t>::max();
  CHECK(forceLevel(samples).median == Approx(9.81));
}

TEST_CASE("units and column order are watched", "[imu_file]") {
  std::string swapped;
  std::string in_g;
  std::string degrees;
  for (int i = 0; i < 50; ++i) {
    const std::string stamp = std::to_string(5000000 * (i + 1));
    swapped += stamp + ",9.7,0.5,-1.25,0.1,-0.2,0.3\n";
    in_g += stamp + ",0.1,-0.2,0.3,0.99,0.05,-0.1\n";
    degrees += stamp + ",30,-20,40,9.7,0.5,-1.25\n";
  }
  CHECK(contains(errorOf([&] { ReadImu{swapped}; }).remedy, "swapped"));
  CHECK(contains(errorOf([&] { ReadImu{in_g}; }).remedy, "in g"));
  CHECK(anyContains(ReadImu(degrees).warnings.lines(), "deg/s"));
  // A header that says so makes the order legal.
  const ReadImu named("#timestamp [ns],a_RS_S_x,a_RS_S_y,a_RS_S_z,w_RS_S_x,w_RS_S_y,w_RS_S_z\n" + swapped);
  CHECK(named.samples[0].accel == Eigen::Vector3d(9.7, 0.5, -1.25));
  CHECK(anyContains(named.warnings.lines(), "accelerometer first"));
  for (const char* header :
       {"timestamp,ax,ay,az,gx,gy,gz", "# t, Accel_x, Accel_y, Accel_z, Gyro_x, Gyro_y, Gyro_z",
        "time,linear_acceleration.x,linear_acceleration.y,linear_acceleration.z,"
        "angular_velocity.x,angular_velocity.y,angular_velocity.z",
        "stamp [ns],a_x [m/s^2],a_y [m/s^2],a_z [m/s^2],w_x [rad/s],w_y [rad/s],w_z [rad/s]"}) {
    INFO(header);
    CHECK(ReadImu(std::string(header) + "\n" + swapped).samples[0].accel == Eigen::Vector3d(9.7, 0.5, -1.25));
  }
}

TEST_CASE("linear acceleration is not taken for g", "[imu_file]") {
  std::string linear;
  for (int i = 0; i < 2000; ++i) {
    linear += std::to_string(5000000LL * (i + 1)) + ",0.1,-0.2,0.3," +
              std::to_string(1.5 * std::sin(0.01 * i)) + ",0.05,-0.1\n";
  }
  const ReadImu read(linear);
  CHECK(forceLevel(read.samples).median == Approx(1.05).margin(0.1));
  CHECK_FALSE(forceLevel(read.samples).inG());
  CHECK(anyContains(read.warnings.lines(), "far from 9.81"));
}

TEST_CASE("the rate is the median of the periods", "[imu_file]") {
  const ReadImu read(rows(0, 100) + rows(400, 420));
  CHECK(medianRate(read.samples) == Approx(200));
  CHECK(medianRate({}) == 0);
}

}  // namespace
}  // namespace swiftlet
