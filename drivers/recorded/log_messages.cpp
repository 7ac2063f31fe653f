#include "drivers/recorded/log_messages.hpp"

namespace swiftlet {
namespace {

template <typename Image>
void writeImage(MessageBag& bag, std::size_t camera, Stamp stamp, const char* tail, Image&& image,
                rosmsg::CameraInfo& info) {
  const std::string name = cameraName(camera);
  image.header = info.header = bagHeader(stamp, name);
  bag.write("/" + name + "/image_raw" + tail, stamp, image);
  bag.write("/" + name + "/camera_info", stamp, info);
}

}  // namespace

rosmsg::Header bagHeader(Stamp stamp, const std::string& frame) {
  rosmsg::Header header;
  header.stamp = stamp;
  header.frame_id = frame;
  return header;
}

std::string cameraName(std::size_t camera) { return "cam" + std::to_string(camera); }

rosmsg::CameraInfo cameraInfoOf(const CameraModel& model) {
  rosmsg::CameraInfo info;
  info.width = static_cast<std::uint32_t>(model.width());
  info.height = static_cast<std::uint32_t>(model.height());
  const Eigen::Vector4d& d = model.distortion();
  info.d.assign(d.data(), d.data() + d.size());
  info.distortion_model = model.kind() == CameraKind::kEquidistant ? "equidistant" : "plumb_bob";
  if (model.kind() == CameraKind::kPinholeRadtan) info.d.push_back(0);  // plumb_bob has five coefficients
  const Eigen::Vector4d& f = model.intrinsics();
  info.k = {f[0], 0, f[2], 0, f[1], f[3], 0, 0, 1};
  info.p = {f[0], 0, f[2], 0, 0, f[1], f[3], 0, 0, 0, 1, 0};
  return info;
}

void writeImu(MessageBag& bag, const ImuSample& sample) {
  rosmsg::Imu imu;
  imu.header = bagHeader(sample.stamp, "imu0");
  imu.angular_velocity = {sample.gyro.x(), sample.gyro.y(), sample.gyro.z()};
  imu.linear_acceleration = {sample.accel.x(), sample.accel.y(), sample.accel.z()};
  bag.write("/imu0", sample.stamp, imu);
}

void writePixels(MessageBag& bag, std::size_t camera, Stamp stamp, std::span<const std::uint8_t> pixels,
                 rosmsg::CameraInfo& info) {
  rosmsg::Image image;
  image.width = info.width;
  image.height = info.height;
  image.encoding = "mono8";
  image.step = info.width;
  image.data = pixels;
  writeImage(bag, camera, stamp, "", image, info);
}

void writePicture(MessageBag& bag, std::size_t camera, Stamp stamp, std::span<const std::uint8_t> picture,
                  rosmsg::CameraInfo& info) {
  constexpr std::uint8_t kPng = 0x89;  // first byte of PNG; JPEG begins with 0xFF
  rosmsg::CompressedImage image;
  image.format = picture.front() == kPng ? "png" : "jpeg";
  image.data = picture;
  writeImage(bag, camera, stamp, "/compressed", image, info);
}

}  // namespace swiftlet
