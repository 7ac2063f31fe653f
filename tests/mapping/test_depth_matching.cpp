// Semi-global matching: scalar twin, shifted images, filters against OpenCV's, true disparities beside
// StereoSGBM, bad input.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "estimator/core/random.hpp"
#include "mapping/depth/semi_global_matcher.hpp"
#include "tests/mapping/depth_sets.hpp"
#include "tests/support/skip_case.hpp"

using namespace swiftlet;
using namespace swiftlet::depth_sets;

namespace {

ImageView viewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

/// Smooth random texture.
cv::Mat texture(int width, int height, std::uint64_t seed) {
  Random random(seed);
  cv::Mat image(height, width, CV_8U);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random.below(256));
  }
  cv::GaussianBlur(image, image, {0, 0}, 1.2);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

/// The right image of a scene whose disparity is `at(y)`: right(x) = left(x + d).
cv::Mat shifted(const cv::Mat& left, const std::function<float(int)>& at) {
  cv::Mat right, map_x(left.size(), CV_32F), map_y(left.size(), CV_32F);
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      map_x.at<float>(y, x) = static_cast<float>(x) + at(y);
      map_y.at<float>(y, x) = static_cast<float>(y);
    }
  }
  cv::remap(left, right, map_x, map_y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return right;
}

bool same(const DisparityImage& a, const DisparityImage& b) {
  if (!std::equal(a.disparity(), a.disparity() + a.pixels(), b.disparity())) return false;
  for (std::size_t i = 0; i < a.pixels(); ++i) {
    if (a.disparity()[i] != kNoDisparity && a.sigma()[i] != b.sigma()[i]) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("depth: the whole matcher gives the scalar twin's bytes, twice the same") {
  // 130 rows: two whole strips and a part of one.
  const cv::Mat left = texture(150, 130, 1);
  const cv::Mat right = shifted(left, [](int y) { return 5.0F + 0.2F * static_cast<float>(y); });
  for (const int disparities : {32, 64, 96, 128}) {
    MatcherSettings settings;
    settings.disparities = disparities;
    SemiGlobalMatcher matcher(left.cols, left.rows, settings);
    DisparityImage native(left.cols, left.rows), scalar(left.cols, left.rows), again(left.cols, left.rows);
    REQUIRE(matcher.match(viewOf(left), viewOf(right), 0, native).ok());
    REQUIRE(matcher.match<disparity_lanes::Scalar>(viewOf(left), viewOf(right), 0, scalar).ok());
    REQUIRE(matcher.match(viewOf(right), viewOf(left), 0, again).ok());
    REQUIRE(matcher.match(viewOf(left), viewOf(right), 0, again).ok());
    CHECK(same(native, scalar));
    CHECK(same(native, again));
  }
  // Less effort is the smaller search.
  MatcherSettings small;
  small.disparities = 32;
  SemiGlobalMatcher matcher(left.cols, left.rows), small_matcher(left.cols, left.rows, small);
  DisparityImage a(left.cols, left.rows), b(left.cols, left.rows);
  REQUIRE(matcher.match(viewOf(left), viewOf(right), 32, a).ok());
  REQUIRE(small_matcher.match(viewOf(left), viewOf(right), 0, b).ok());
  CHECK(same(a, b));
}

// Where disparity is the same everywhere, the penalties of all paths stand about the whole disparity and draw
// the fit towards it; on slanted ground they do not. Without paths from below, ground comes out 0.2 px off.
TEST_CASE("depth: slanted ground comes out without bias, level shifts within a quarter pixel") {
  const cv::Mat left = texture(320, 200, 2);
  for (const float slope : {0.0F, 0.12F, -0.12F}) {
    for (const float start : {12.0F, 12.25F, 12.5F, 30.4F}) {
      const auto disparity_at = [&](int y) { return start + slope * static_cast<float>(y - 100); };
      const cv::Mat right = shifted(left, disparity_at);
      SemiGlobalMatcher matcher(left.cols, left.rows);
      DisparityImage image(left.cols, left.rows);
      REQUIRE(matcher.match(viewOf(left), viewOf(right), 0, image).ok());
      const cv::Mat found = disparityOf(image);
      double sum = 0, squares = 0, count = 0, all = 0;
      for (int y = 8; y < left.rows - 8; ++y) {
        for (int x = 56; x < left.cols - 8; ++x, ++all) {
          const double error = found.at<float>(y, x) - disparity_at(y);
          if (found.at<float>(y, x) < 0 || std::abs(error) > 1) continue;
          sum += error;
          squares += error * error;
          ++count;
        }
      }
      INFO("slope " << slope << ", from " << start << ": share " << count / all << ", bias " << sum / count
                    << ", rms " << std::sqrt(squares / count));
      CHECK(count > 0.98 * all);
      CHECK(std::abs(sum / count) < (slope != 0 ? 0.04 : 0.25));
      CHECK(std::sqrt(squares / count) < (slope != 0 ? 0.15 : 0.25));
    }
  }
}

TEST_CASE("depth: the speckle filter removes what OpenCV's does") {
  Random random(4);
  constexpr int kWidth = 90, kHeight = 70;
  for (int round = 0; round < 20; ++round) {
    // Patches of a few levels, with gaps.
    cv::Mat levels(kHeight, kWidth, CV_16S);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        levels.at<std::int16_t>(y, x) =
            static_cast<std::int16_t>(random.below(3 + static_cast<unsigned>(round) / 4) * 100);
    }
    DisparityImage image(kWidth, kHeight);
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      std::int16_t& level = levels.ptr<std::int16_t>()[i];
      if (random.below(10) == 0) level = -1;
      image.disparity()[i] = level < 0 ? kNoDisparity : static_cast<std::uint16_t>(level);
    }
    constexpr int kLeast = 8;
    SpeckleFilter filter(kWidth, kHeight);
    const std::size_t removed = filter.remove(image, kLeast, 50);
    // OpenCV removes patches of at most so many.
    cv::Mat expected = levels.clone();
    cv::filterSpeckles(expected, -1, kLeast - 1, 50);
    std::size_t differ = 0, gone = 0;
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      const std::int16_t level = expected.ptr<std::int16_t>()[i];
      differ +=
          image.disparity()[i] != (level < 0 ? kNoDisparity : static_cast<std::uint16_t>(level)) ? 1U : 0U;
      gone += level < 0 && levels.ptr<std::int16_t>()[i] >= 0 ? 1U : 0U;
    }
    CHECK(differ == 0);
    CHECK(gone > 0);
    CHECK(removed == gone);
  }
}

TEST_CASE("depth: the median is OpenCV's where all is known, and closes small holes only") {
  Random random(5);
  constexpr int kWidth = 77, kHeight = 40;
  DisparityImage image(kWidth, kHeight);
  for (std::size_t i = 0; i < image.pixels(); ++i)
    image.disparity()[i] = static_cast<std::uint16_t>(random.below(4000));
  const cv::Mat before = cv::Mat(kHeight, kWidth, CV_16U, image.disparity()).clone();
  cv::Mat expected;
  cv::medianBlur(before, expected, 3);
  MedianFilter filter(kWidth, kHeight);
  filter.filter(image);
  const cv::Mat after(kHeight, kWidth, CV_16U, image.disparity());
  const cv::Rect inside(1, 1, kWidth - 2, kHeight - 2);
  CHECK(cv::countNonZero(after(inside) != expected(inside)) == 0);

  DisparityImage holes(kWidth, kHeight);
  std::fill_n(holes.disparity(), holes.pixels(), std::uint16_t{640});
  const auto at = [&](int x, int y) -> std::uint16_t& { return holes.disparity()[y * kWidth + x]; };
  at(10, 10) = kNoDisparity;                                               // one pixel
  for (int y = 20; y < 25; ++y) std::fill_n(&at(30, y), 5, kNoDisparity);  // 5 x 5
  at(50, 10) = kNoDisparity;                                               // at a step
  for (int y = 9; y < 12; ++y) at(51, y) = 2000;
  filter.filter(holes);
  CHECK(at(10, 10) == 640);
  CHECK(holes.sigma()[10 * kWidth + 10] == kDisparitySteps);
  CHECK(at(32, 22) == kNoDisparity);
  CHECK(at(30, 22) == kNoDisparity);
  CHECK(at(50, 10) == kNoDisparity);
}

TEST_CASE("depth: bad input is refused and leaves the output alone") {
  const cv::Mat image = texture(64, 48, 6);
  SemiGlobalMatcher matcher(64, 48);
  DisparityImage out(64, 48), small(63, 48);
  out.disparity()[5] = 77;
  const ImageView good = viewOf(image);
  ImageView narrow = good, thin = good;
  narrow.width = 63;
  thin.stride = 10;
  CHECK(matcher.match({}, good, 0, out).code == StatusCode::kInvalidInput);
  CHECK(matcher.match(good, {}, 0, out).code == StatusCode::kInvalidInput);
  CHECK(matcher.match(narrow, good, 0, out).code == StatusCode::kInvalidInput);
  CHECK(matcher.match(good, thin, 0, out).code == StatusCode::kInvalidInput);
  CHECK(matcher.match(good, good, 0, small).code == StatusCode::kInvalidInput);
  CHECK(out.disparity()[5] == 77);
  CHECK(matcher.match(good, good, 0, out).ok());
  // Sizes at the edge of what there is: a pixel, a row, a column; flat images.
  for (const auto& [width, height] : {std::pair{1, 1}, {40, 1}, {1, 40}, {3, 3}}) {
    SemiGlobalMatcher tiny(width, height);
    DisparityImage tiny_out(width, height);
    const cv::Mat flat(height, width, CV_8U, cv::Scalar(100));
    CHECK(tiny.match(viewOf(flat), viewOf(flat), 0, tiny_out).ok());
  }
  CHECK(SemiGlobalMatcher(0, 0).match(good, good, 0, out).code == StatusCode::kInvalidInput);
  MatcherSettings wild;
  wild.disparities = 1000;
  wild.small_penalty = -4;
  wild.large_penalty = 4000;
  wild.outside_cost = 300;
  const SemiGlobalMatcher tamed(64, 48, wild);
  CHECK(tamed.settings().disparities == 128);
  CHECK(tamed.settings().small_penalty == 1);
  CHECK(tamed.settings().large_penalty + kCensusSigns == 255);
  CHECK(tamed.settings().outside_cost == kCensusSigns);
}

TEST_CASE("depth: true disparities beside OpenCV's StereoSGBM") {
  std::vector<StereoSet> sets = realSets();
  if (sets.empty()) skipCase("no stereo_gt in the folder of logs", kRunWithData);
  for (const char* log : {"vil_v102", "vil_mh05"}) {
    std::vector<StereoSet> rendered = renderedSets(log, 3);
    if (rendered.empty()) skipCase(std::string("no ") + log + " in the folder of logs", kRunWithData);
    for (StereoSet& set : rendered) sets.push_back(std::move(set));
  }
  cv::setNumThreads(1);
  double ours_sum = 0, theirs_sum = 0;
  for (const StereoSet& set : sets) {
    SemiGlobalMatcher matcher(set.left.cols, set.left.rows);
    DisparityImage image(set.left.cols, set.left.rows);
    REQUIRE(matcher.match(viewOf(set.left), viewOf(set.right), 0, image).ok());
    const auto sgbm =
        cv::StereoSGBM::create(0, 64, 5, 200, 800, -1, 63, 0, 0, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
    cv::Mat fixed, theirs;
    sgbm->compute(set.left, set.right, fixed);
    fixed.convertTo(theirs, CV_32F, 1 / 16.0);
    const DisparityScore a = score(disparityOf(image), sigmaOf(image), set.truth);
    const DisparityScore b = score(theirs, {}, set.truth);
    INFO(set.name << ": wrong or missing " << a.wrong_or_missing << ", StereoSGBM " << b.wrong_or_missing
                  << ", wrong of those given " << a.wrong << ", " << b.wrong << ", bias " << a.bias);
    CHECK(a.wrong_or_missing < 1.4 * b.wrong_or_missing);
    CHECK(a.wrong < b.wrong + 0.01);
    CHECK(a.wrong_or_missing < 0.25);
    // Sigma is neither a wish nor a fear. (Truth in steps of a pixel says nothing about it.)
    if (set.name != "tsukuba" && set.name != "adirondack") {
      CHECK(a.within_sigma[0] > 0.55);
      CHECK(a.within_sigma[0] < 0.95);
      CHECK(a.within_sigma[2] > 0.95);
    }
    ours_sum += a.wrong_or_missing;
    theirs_sum += b.wrong_or_missing;
  }
  CHECK(ours_sum <= theirs_sum);
}
