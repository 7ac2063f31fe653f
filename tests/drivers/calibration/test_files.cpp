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
                       "not a camera calibration"));
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

TEST_CASE("ROS, OpenCV and Basalt files are found by content, and an IMU file that is missing is asked for",
          "[calibration]") {
  const Folder folder;
  const std::string camera =
      "image_width: 640\nimage_height: 480\ncamera_matrix: [300, 0, 320, 0, 300, 240, 0, 0, 1]\n"
      "distortion_coefficients: [0, 0, 0, 0, 0]\n";
  folder.write("a.yaml", camera + "camera_name: left\n");
  CHECK(hasCalibration(folder.path()));
  const InputError missing = errorOf([&] { readCalibration(folder / "a.yaml"); });
  CHECK(missing.file == (folder / "a.yaml"));
  CHECK(test::contains(missing.message, "only cameras"));
  CHECK(test::contains(missing.remedy, "T_imu_cam0"));
  folder.write("imu.yaml", test::KalibrTexts().imu +
                               "T_imu_cam0: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n");
  CHECK(readCalibration(folder / "a.yaml").form == "ROS CameraInfo");
  CHECK(readCalibration(folder.path()).rig.camera_count == 1);
  folder.write("b.yaml", camera + "camera_name: right\n");
  CHECK(errorOf([&] { readCalibration(folder.path()); }).field == "T_imu_cam1");
  folder.write("c.yaml", camera + "camera_name: third\n");
  CHECK(test::contains(errorOf([&] { readCalibration(folder.path()); }).message, "three camera_info files"));
  for (const char* name : {"a.yaml", "b.yaml", "c.yaml"}) fs::remove(folder / name);
  CHECK(!hasCalibration(folder.path()));
  folder.write("camera.yml", camera);
  CHECK(readCalibration(folder.path()).form == "OpenCV");
  CHECK(readCalibration(folder / "camera.yml", folder / "imu.yaml").form == "OpenCV");
  folder.write("basalt.json", "{\"value0\": {\"T_imu_cam\": [], \"intrinsics\": []}}\n");
  CHECK(errorOf([&] { readCalibration(folder.path()); }).file == (folder / "basalt.json"));
}

}  // namespace
}  // namespace swiftlet
