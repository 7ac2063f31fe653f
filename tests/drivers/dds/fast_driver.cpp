// Stands for a camera's ROS 2 driver, over eProsima Fast DDS: two cameras with CameraInfo and an IMU, of a
// recorded log or made up, in real time on the wall clock.
// usage: dds_driver [domain=0] [log=] (EuRoC folder; empty: made up, test_topics.hpp) [seconds=0] (of images;
//   0: all of the log) [lead=3] (s of black images before the log) [images=raw] (or
//   compressed: the log's files; bad: by turns malformed ones) [imu=united] (or apart) [late=0] (ms, of every
//   fifth image and for all of the IMU's messages every half second) [lose=0] (every so many-th message of a
//   stream is withheld) [ahead=0] (s, of all stamps) [width=640] [height=480] [rate=30] (of what is made up)
// Shows the same until somebody reads all its images and samples, and begins then. Says "ready", then "first
// NS NS", the first image's stamp on the wall clock and the log's, "ended", and, when its standard input has
// ended, "driver SENT WITHHELD TWICE" and so on, of camera 0, camera 1 and the IMU from the first on.

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "drivers/recorded/image_files.hpp"
#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "tests/drivers/dds/fast_peer.hpp"
#include "tests/drivers/dds/test_topics.hpp"
#include "tests/support/text.hpp"

namespace {

using namespace swiftlet;        // NOLINT(google-build-using-namespace)
using namespace swiftlet::test;  // NOLINT(google-build-using-namespace)
using Image = sensor_msgs::msg::dds_::Image_;
using Picture = sensor_msgs::msg::dds_::CompressedImage_;
using Imu = sensor_msgs::msg::dds_::Imu_;
using Info = sensor_msgs::msg::dds_::CameraInfo_;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kMillisecond = 1'000'000;
/// From the exposure to the publishing: what readout and USB take.
constexpr std::int64_t kTransfer = 4 * kMillisecond;

std::int64_t wallNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

struct Options {
  std::map<std::string, std::string> text = {
      {"domain", "0"},   {"log", ""},       {"seconds", "0"}, {"lead", "3"},  {"images", "raw"},
      {"imu", "united"}, {"late", "0"},     {"lose", "0"},    {"twice", "0"}, {"ahead", "0"},
      {"width", "640"},  {"height", "480"}, {"rate", "30"}};
  [[nodiscard]] double number(const char* name) const { return std::atof(text.at(name).c_str()); }
  [[nodiscard]] bool is(const char* name, const char* value) const { return text.at(name) == value; }
};

/// What is played: stamps of the images in ns from the first one, pictures and samples.
class Content {
 public:
  explicit Content(const Options& options) : log_(options.text.at("log")), rate_(options.number("rate")) {
    width = static_cast<int>(options.number("width"));
    height = static_cast<int>(options.number("height"));
    const double seconds = options.number("seconds");
    if (log_.empty()) {
      for (int i = 0; i < seconds * rate_; ++i) images.push_back(std::llround(i * kSecond / rate_));
      period = std::llround(kSecond / rate_);
      for (std::int64_t t = 0; t < seconds * kSecond; t += kImuPeriod) {
        const Eigen::Vector3d value = madeUpGyro(static_cast<std::uint64_t>(samples.size()));
        samples.push_back({{t}, value, value + Eigen::Vector3d(0, 0, kMadeUpGravity)});
      }
      return;
    }
    LogCounters counters;
    LogWarnings warnings;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      const std::string folder = log_ + "/mav0/cam" + std::to_string(i);
      for (const ImageRow& row : readImageList(folder + "/data.csv", counters, warnings)) {
        files_.at(i).push_back(folder + "/data/" + row.file);
        if (i == 0) images.push_back(row.stamp.ns);
      }
    }
    first = images.front();
    period = images[1] - images[0];
    for (std::int64_t& image : images) image -= first;
    if (seconds > 0) std::erase_if(images, [&](std::int64_t t) { return t > seconds * kSecond; });
    samples = readImuFile(log_ + "/mav0/imu0/data.csv", counters, warnings);
    for (ImuSample& sample : samples) sample.stamp.ns -= first;
    std::erase_if(samples, [&](const ImuSample& s) { return s.stamp.ns > images.back() + period; });
  }

  /// Grey pixels of an image; below 0: black.
  void pixels(std::size_t camera, std::int64_t index, std::vector<std::uint8_t>& out) {
    out.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    if (log_.empty()) {
      fillPattern(out, patternOf(camera, index));
    } else if (index < 0) {
      std::ranges::fill(out, 0);
    } else {
      ImageSize found;
      if (decoder_.decode(picture(camera, index), {width, height}, out.data(), found) != DecodeResult::kOk)
        std::abort();
    }
  }
  /// A picture's bytes: of the log, black PNG before it.
  [[nodiscard]] const std::vector<std::uint8_t>& picture(std::size_t camera, std::int64_t index) {
    if (index < 0 && !black_.empty()) return picture_ = black_;
    if (index >= 0) return picture_ = bytesOf(files_.at(camera).at(static_cast<std::size_t>(index)));
    const auto file = std::filesystem::temp_directory_path() / ("black_" + std::to_string(getpid()) + ".png");
    const std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width) *
                                           static_cast<std::size_t>(height));
    writePng8(file.string(), pixels.data(), width, height);
    black_ = bytesOf(file);
    std::filesystem::remove(file);
    return black_;
  }

  std::int64_t first = 0;   ///< ns, of the log's clock
  std::int64_t period = 0;  ///< ns, of images
  int width = 0;
  int height = 0;
  std::vector<std::int64_t> images;
  std::vector<ImuSample> samples;

 private:
  static constexpr std::int64_t kImuPeriod = std::llround(kSecond / kMadeUpImuRate);
  std::string log_;
  double rate_;
  std::array<std::vector<std::string>, 2> files_;
  ImageDecoder decoder_;
  std::vector<std::uint8_t> black_, picture_;
};

struct Count {
  std::uint64_t sent = 0, withheld = 0, twice = 0;
};

class Driver {
 public:
  explicit Driver(const Options& options)
      : options_(options),
        content_(options),
        peer_(static_cast<std::uint32_t>(options.number("domain"))),
        compressed_(options.is("images", "compressed")),
        apart_(options.is("imu", "apart")) {
    if (options.text.at("log").size() > 0) {
      content_.width = 752;
      content_.height = 480;
    }
    for (std::size_t i = 0; i < 2; ++i) {
      const std::string name = kTopicCameras[i];
      images_[i] =
          compressed_ ? peer_.writer<sensor_msgs::msg::dds_::CompressedImage_PubSubType>(name + "/compressed")
                      : peer_.writer<sensor_msgs::msg::dds_::Image_PubSubType>(name);
      infos_[i] = peer_.writer<sensor_msgs::msg::dds_::CameraInfo_PubSubType>(kTopicInfos[i]);
    }
    using ImuType = sensor_msgs::msg::dds_::Imu_PubSubType;
    imu_ = peer_.writer<ImuType>(apart_ ? kTopicGyro : kTopicImu, false);
    if (apart_) accel_ = peer_.writer<ImuType>(kTopicAccel, false);
  }

  void run() {
    const auto late = static_cast<std::int64_t>(options_.number("late") * kMillisecond);
    ahead_ = static_cast<std::int64_t>(options_.number("ahead") * kSecond);
    const std::int64_t lead = static_cast<std::int64_t>(options_.number("lead")) * kSecond;
    const std::int64_t before = lead / content_.period;
    if (!warmUp(before)) return;
    std::printf("first %lld %lld\n", static_cast<long long>(begin_ + ahead_),
                static_cast<long long>(content_.first));
    std::fflush(stdout);
    const auto last = static_cast<std::int64_t>(content_.images.size());
    prepareSamples(before * content_.period);
    std::int64_t image = 1 - before;
    bool drawn = false;
    while (image < last || next_sample_ < content_.samples.size()) {
      const bool has_image = image < last;
      const std::int64_t time = has_image ? timeOf(image) : 0;
      const bool is_late = late > 0 && image >= 0 && image % 5 == 4;
      const std::int64_t due = begin_ + time + kTransfer + (is_late ? late : 0);
      const std::int64_t sample_due =
          next_sample_ < content_.samples.size() ? begin_ + dueOf(next_sample_, late) : INT64_MAX;
      if (has_image && due <= sample_due) {
        if (!drawn) draw(image);
        sleepUntil(due);
        for (std::size_t i = 0; i < 2 && (image >= 0 || time < dark_until_); ++i) {
          if (withholds(counts_[i], image, last)) continue;
          publishImage(i, begin_ + time);
          if (!repeats(image)) continue;
          ++counts_[i].twice;
          publishImage(i, begin_ + time);
        }
        ++image;
        drawn = false;
        continue;
      }
      // Where there is time, the next image is made before.
      if (has_image && !drawn && sample_due - wallNow() > kMillisecond) {
        draw(image);
        drawn = true;
      }
      sleepUntil(sample_due);
      publishSample(next_sample_++);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
  }

  void report() const {
    std::printf("driver");
    for (const Count* count : {&counts_[0], &counts_[1], &imu_count_}) {
      std::printf(" %llu %llu %llu", static_cast<unsigned long long>(count->sent),
                  static_cast<unsigned long long>(count->withheld),
                  static_cast<unsigned long long>(count->twice));
    }
    std::printf("\n");
  }

 private:
  static bool inputEnded() {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    return ::poll(&input, 1, 0) != 0;
  }
  [[nodiscard]] static bool isRead(fast::DataWriter* writer) {
    fast::PublicationMatchedStatus status;
    writer->get_publication_matched_status(status);
    return status.current_count > 0;
  }
  /// The first image and a sensor at rest, until all is read. False: the input ended before.
  bool warmUp(std::int64_t before) {
    std::printf("ready\n");
    std::fflush(stdout);
    const std::int64_t origin = wallNow();
    const std::int64_t sample_period = content_.samples[1].stamp.ns - content_.samples[0].stamp.ns;
    const std::int64_t each = content_.period / sample_period;
    for (std::int64_t tick = 1;; ++tick) {
      const std::int64_t now = origin + tick * content_.period;
      draw(-before - 1 - tick);
      for (std::int64_t i = each - 1; i >= 0; --i) publishRest(now - i * sample_period);
      sleepUntil(now + kTransfer);
      for (std::size_t i = 0; i < 2; ++i) publishImage(i, now);
      if (inputEnded()) return false;
      begin_ = now + before * content_.period;
      const bool all =
          isRead(images_[0]) && isRead(images_[1]) && isRead(imu_) && (!apart_ || isRead(accel_));
      if (all) return true;
    }
  }

  static void sleepUntil(std::int64_t wall) {
    const std::int64_t left = wall - wallNow();
    if (left > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(left));
  }

  [[nodiscard]] std::int64_t timeOf(std::int64_t image) const {
    return image < 0 ? image * content_.period : content_.images[static_cast<std::size_t>(image)];
  }
  /// What is made up stands still before. Of a log the black images end before its samples begin: a vehicle
  /// that moves, or stands, in front of black images is a flight that nobody made.
  void prepareSamples(std::int64_t lead) {
    std::vector<ImuSample>& samples = content_.samples;
    if (content_.first != 0) {
      dark_until_ = samples.front().stamp.ns - 2 * content_.period;
      return;
    }
    const std::int64_t period = samples[1].stamp.ns - samples[0].stamp.ns;
    std::vector<ImuSample> all;
    for (std::int64_t n = (lead - 1) / period; n > 0; --n) {
      all.push_back(samples[0]);
      all.back().stamp.ns -= n * period;
    }
    lead_samples_ = static_cast<std::int64_t>(all.size());
    all.insert(all.end(), samples.begin(), samples.end());
    samples = std::move(all);
  }
  /// Held up twice a second where messages come late: a burst ends it.
  [[nodiscard]] std::int64_t dueOf(std::size_t i, std::int64_t late) const {
    const std::int64_t at = content_.samples[i].stamp.ns;
    const std::int64_t stall = at - (at % (kSecond / 2));
    return late > 0 && at >= 0 && at - stall < late ? stall + late : at + kMillisecond;
  }

  void stamp(std_msgs::msg::dds_::Header_& header, std::int64_t wall, const char* frame) const {
    const std::int64_t told = wall + ahead_;
    header.stamp().sec(static_cast<std::int32_t>(told / kSecond));
    header.stamp().nanosec(static_cast<std::uint32_t>(told % kSecond));
    header.frame_id(frame);
  }

  void draw(std::int64_t image) {
    for (std::size_t i = 0; i < 2; ++i) {
      if (compressed_) {
        picture_[i].data(content_.picture(i, image));
        picture_[i].format("mono8; jpeg compressed mono8");
        continue;
      }
      content_.pixels(i, image, image_[i].data());
      image_[i].encoding("mono8");
      image_[i].width(static_cast<std::uint32_t>(content_.width));
      image_[i].height(static_cast<std::uint32_t>(content_.height));
      image_[i].step(image_[i].width());
      if (options_.is("images", "bad")) spoil(image_[i], image);
    }
  }
  /// By turns sound and every kind of malformed.
  static void spoil(Image& image, std::int64_t n) {
    if (n % 2 == 0) return;
    switch ((n / 2) % 8) {
      case 0:
        image.step(image.width() - 1);
        break;
      case 1:
        image.data().resize(image.data().size() / 2);
        break;
      case 2:
        image.width(0xffffffff);
        image.height(0xffffffff);
        break;
      case 3:
        image.encoding("32FC1");
        break;
      case 4:
        image.step(0xffffffff);
        break;
      case 5:
        image.data().clear();
        break;
      case 6:
        image.encoding(std::string(100'000, 'x'));
        break;
      default:
        image.width(0);
        image.height(0);
    }
  }

  void publishInfo(std::size_t camera, std::int64_t wall) {
    Info info;
    stamp(info.header(), wall, "camera_optical_frame");
    info.width(static_cast<std::uint32_t>(content_.width));
    info.height(static_cast<std::uint32_t>(content_.height));
    info.distortion_model("plumb_bob");
    // EuRoC's cameras.
    const std::array<double, 4> k = camera == 0 ? std::array{458.654, 457.296, 367.215, 248.375}
                                                : std::array{457.587, 456.134, 379.999, 255.238};
    info.d(camera == 0 ? std::vector{-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0}
                       : std::vector{-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05, 0.0});
    info.k({k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1});
    info.r({1, 0, 0, 0, 1, 0, 0, 0, 1});
    info.p({k[0], 0, k[2], 0, 0, k[1], k[3], 0, 0, 0, 1, 0});
    infos_[camera]->write(&info);
  }

  /// Counted from the first on; withheld is none of the first or last.
  [[nodiscard]] bool withholds(Count& count, std::int64_t index, std::int64_t end) const {
    if (index < 0) return false;
    const auto lose = static_cast<std::int64_t>(options_.number("lose"));
    const bool held = lose > 0 && index % lose == lose - 1 && index > 10 && index + 10 < end;
    ++(held ? count.withheld : count.sent);
    return held;
  }

  [[nodiscard]] bool repeats(std::int64_t index) const {
    const auto twice = static_cast<std::int64_t>(options_.number("twice"));
    return index >= 0 && twice > 0 && index % twice == twice - 2;
  }

  void publishImage(std::size_t i, std::int64_t wall) {
    publishInfo(i, wall);
    if (compressed_) {
      stamp(picture_[i].header(), wall, "camera_optical_frame");
      images_[i]->write(&picture_[i]);
      return;
    }
    stamp(image_[i].header(), wall, "camera_optical_frame");
    images_[i]->write(&image_[i]);
  }

  void publishSample(std::size_t i) {
    const ImuSample& sample = content_.samples[i];
    const auto index = static_cast<std::int64_t>(i) - lead_samples_;
    const auto end = static_cast<std::int64_t>(content_.samples.size()) - lead_samples_;
    const Eigen::Vector3d accel = apart_ ? Eigen::Vector3d::Zero() : sample.accel;
    Eigen::Vector3d gyro = sample.gyro;
    if (options_.is("images", "bad") && i % 3 == 1) gyro.y() = std::nan("");
    if (!withholds(imu_count_, index, end)) {
      publishImu(imu_, begin_ + sample.stamp.ns, gyro, accel);
      if (repeats(index)) {
        ++imu_count_.twice;
        publishImu(imu_, begin_ + sample.stamp.ns, gyro, accel);
      }
    }
    if (!apart_ || i % 2 == 0) return;
    // The accelerometer has half the rate, and its instants between those of the gyro.
    const ImuSample& other = content_.samples[i - 1];
    publishImu(accel_, begin_ + (sample.stamp.ns + other.stamp.ns) / 2, Eigen::Vector3d::Zero(),
               0.5 * (sample.accel + other.accel));
  }

  void publishRest(std::int64_t wall) {
    const ImuSample& rest = content_.samples.front();
    publishImu(imu_, wall, rest.gyro, apart_ ? Eigen::Vector3d::Zero() : rest.accel);
    if (apart_) publishImu(accel_, wall, Eigen::Vector3d::Zero(), rest.accel);
  }

  void publishImu(fast::DataWriter* writer, std::int64_t wall, const Eigen::Vector3d& gyro,
                  const Eigen::Vector3d& accel) const {
    Imu message;
    stamp(message.header(), wall, "camera_imu_optical_frame");
    message.orientation_covariance()[0] = -1;
    const auto fill = [](geometry_msgs::msg::dds_::Vector3_& to, const Eigen::Vector3d& from) {
      to.x(from.x());
      to.y(from.y());
      to.z(from.z());
    };
    fill(message.angular_velocity(), gyro);
    fill(message.linear_acceleration(), accel);
    writer->write(&message);
  }

  const Options& options_;
  Content content_;
  Peer peer_;
  const bool compressed_;
  const bool apart_;
  std::array<fast::DataWriter*, 2> images_{};
  std::array<fast::DataWriter*, 2> infos_{};
  fast::DataWriter* imu_ = nullptr;
  fast::DataWriter* accel_ = nullptr;
  std::array<Image, 2> image_;
  std::array<Picture, 2> picture_;
  std::int64_t begin_ = 0;  ///< wall clock, ns, of the first image
  std::int64_t ahead_ = 0;
  std::int64_t dark_until_ = 0;  ///< ns, from the first image
  std::size_t next_sample_ = 0;
  std::int64_t lead_samples_ = 0;
  std::array<Count, 2> counts_;
  Count imu_count_;
};

}  // namespace

int main(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || !options.text.contains(text.substr(0, equals))) {
      std::fprintf(stderr, "dds_driver: unknown argument %s\n", argv[i]);
      return 2;
    }
    options.text[text.substr(0, equals)] = text.substr(equals + 1);
  }
  Driver driver(options);
  driver.run();
  std::printf("ended\n");
  std::fflush(stdout);
  for (char byte = 0; read(STDIN_FILENO, &byte, 1) > 0;) {
  }
  driver.report();
  return 0;
}
