#pragma once
// Bodies of ROS 1 messages as a publisher would serialize them.

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet::test {

class RosBody {
 public:
  template <typename T>
  RosBody& put(const T& value) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_.insert(bytes_.end(), bytes, bytes + sizeof(T));
    return *this;
  }
  RosBody& putText(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size()));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return *this;
  }
  RosBody& putBytes(const std::vector<std::uint8_t>& data) {
    put(static_cast<std::uint32_t>(data.size()));
    bytes_.insert(bytes_.end(), data.begin(), data.end());
    return *this;
  }
  RosBody& putHeader(Stamp stamp) {
    put(std::uint32_t{42});
    put(static_cast<std::uint32_t>(stamp.ns / 1'000'000'000));
    put(static_cast<std::uint32_t>(stamp.ns % 1'000'000'000));
    return putText("frame");
  }
  [[nodiscard]] const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

inline std::vector<std::uint8_t> imuBody(Stamp stamp, const Eigen::Vector3d& gyro,
                                         const Eigen::Vector3d& accel) {
  RosBody body;
  body.putHeader(stamp);
  for (int i = 0; i < 4 + 9; ++i) body.put(-1.0);  // orientation and its covariance
  for (int i = 0; i < 3; ++i) body.put(gyro[i]);
  for (int i = 0; i < 9; ++i) body.put(0.5);
  for (int i = 0; i < 3; ++i) body.put(accel[i]);
  for (int i = 0; i < 9; ++i) body.put(0.5);
  return body.bytes();
}

inline std::vector<std::uint8_t> imageBody(Stamp stamp, int width, int height, const std::string& encoding,
                                           std::uint32_t step, const std::vector<std::uint8_t>& data,
                                           bool big_endian = false) {
  RosBody body;
  body.putHeader(stamp).put(static_cast<std::uint32_t>(height)).put(static_cast<std::uint32_t>(width));
  body.putText(encoding).put(static_cast<std::uint8_t>(big_endian)).put(step).putBytes(data);
  return body.bytes();
}

inline std::vector<std::uint8_t> compressedBody(Stamp stamp, const std::vector<std::uint8_t>& data) {
  return RosBody().putHeader(stamp).putText("jpeg").putBytes(data).bytes();
}

}  // namespace swiftlet::test
