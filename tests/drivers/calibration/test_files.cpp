// Which files are found, told by content.

#include <unistd.h>

#include "tests/drivers/calibration/texts.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using test::errorOf;

class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "swiftlet_calibration_XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() { fs::remove_all(path_); }
  void write(const std::string& name, const std::string& text) const {
    fs::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  fs::path path_;
};

TEST_CASE("a EuRoC sequence, its mav0 and one of its files lead to the same rig", "[calibration]") {
  const Folder folder;
  const test::EurocTexts texts;
  folder.write("mav0/cam0/sensor.yaml", texts.cam0);
  folder.write("mav0/cam1/sensor.yaml", texts.cam1);
  folder.write("mav0/imu0/sensor.yaml", texts.imu);
  CHECK(hasCalibration(folder.path()));
  for (const std::string& path : {folder.path(), folder / "mav0", folder / "mav0/cam0/sensor.yaml"}) {
    const Calibration calibration = readCalibration(path);
    CHECK(calibration.form == "EuRoC");
    CHECK(calibration.rig.baseline() == Approx(0.11007784219171352).epsilon(1e-12));
  }
  fs::remove(folder / "mav0/imu0/sensor.yaml");
  CHECK(errorOf([&] { readCalibration(folder.path()); }).file == (folder / "mav0/imu0/sensor.yaml"));
}

TEST_CASE("Kalibr files are found by content, whatever their names", "[calibration]") {
  const Folder folder;
  const test::KalibrTexts texts;
  folder.write("a.yaml", texts.imu);
  folder.write("b.yaml", texts.chain);
  folder.write("target.yaml", "target_type: aprilgrid\n");
  CHECK(hasCalibration(folder.path()));
  CHECK(readCalibration(folder.path()).form == "Kalibr");
  CHECK(readCalibration(folder / "b.yaml").form == "Kalibr");
  CHECK(readCalibration(folder / "b.yaml", folder / "a.yaml").form == "Kalibr");
  CHECK(test::contains(errorOf([&] { readCalibration(folder / "target.yaml"); }).message,
                       "not a calibration of cameras"));
  folder.write("c.yaml", texts.imu);
  CHECK(test::contains(errorOf([&] { readCalibration(folder.path()); }).message, "a.yaml and c.yaml"));
  fs::remove(folder / "a.yaml");
  fs::remove(folder / "c.yaml");
  CHECK(test::contains(errorOf([&] { readCalibration(folder.path()); }).message, "no Kalibr IMU file"));
}

TEST_CASE("absent calibration says what to give", "[calibration]") {
  const Folder folder;
  CHECK(!hasCalibration(folder.path()));
  CHECK(test::contains(errorOf([&] { readCalibration(folder.path()); }).remedy, "sensor.yaml"));
  CHECK(test::contains(errorOf([&] { readCalibration(folder / "nowhere"); }).message, "does not exist"));
}

}  // namespace
}  // namespace swiftlet
