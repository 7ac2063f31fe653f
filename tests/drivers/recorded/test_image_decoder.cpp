// The picture codecs beside OpenCV's (the oracle).

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "drivers/image/image_decoder.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

constexpr int kWidth = 203;
constexpr int kHeight = 97;

cv::Mat textured(int type) {
  cv::Mat image(kHeight, kWidth, type);
  Random random(11);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int value = (x * 3 + y * 5 + static_cast<int>(random.below(40))) & 255;
      if (type == CV_8UC1) image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value);
      if (type == CV_16UC1)
        image.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(value * 257 - value / 2);
      if (type == CV_8UC3)
        image.at<cv::Vec3b>(y, x) =
            cv::Vec3b(static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(255 - value),
                      static_cast<std::uint8_t>(x));
    }
  }
  return image;
}

std::vector<std::uint8_t> decoded(const std::vector<std::uint8_t>& bytes,
                                  DecodeResult expected = DecodeResult::kOk) {
  ImageDecoder decoder;
  std::vector<std::uint8_t> out(kWidth * kHeight);
  ImageSize found;
  CHECK(decoder.decode(bytes, {kWidth, kHeight}, out.data(), found) == expected);
  return out;
}

std::vector<std::uint8_t> pixelsOf(const cv::Mat& image) { return {image.datastart, image.dataend}; }

TEST_CASE("8-bit PNG is exact", "[image_decoder]") {
  const cv::Mat image = textured(CV_8UC1);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  CHECK(decoded(bytes) == pixelsOf(image));
}

TEST_CASE("16-bit PNG is kept exactly for depth, and nothing else is taken for it", "[image_decoder]") {
  const cv::Mat image = textured(CV_16UC1);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  std::vector<std::uint16_t> out(kWidth * kHeight);
  ImageSize found;
  REQUIRE(ImageDecoder::decode16(bytes, {kWidth, kHeight}, out.data(), found) == DecodeResult::kOk);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    REQUIRE(out[static_cast<std::size_t>(i)] == image.at<std::uint16_t>(i / kWidth, i % kWidth));
  }
  CHECK(ImageDecoder::decode16(bytes, {kWidth + 1, kHeight}, out.data(), found) == DecodeResult::kWrongSize);
  bytes.resize(bytes.size() / 2);
  CHECK(ImageDecoder::decode16(bytes, {kWidth, kHeight}, out.data(), found) == DecodeResult::kDamaged);
  cv::imencode(".png", textured(CV_8UC1), bytes);
  CHECK(ImageDecoder::decode16(bytes, {kWidth, kHeight}, out.data(), found) == DecodeResult::kDamaged);
}

TEST_CASE("16-bit PNG is scaled and rounded", "[image_decoder]") {
  const cv::Mat image = textured(CV_16UC1);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  const std::vector<std::uint8_t> out = decoded(bytes);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const double exact = image.at<std::uint16_t>(i / kWidth, i % kWidth) * 255.0 / 65535.0;
    REQUIRE(std::abs(out[static_cast<std::size_t>(i)] - exact) <= 0.5 + 1e-9);
  }
}

TEST_CASE("colour and one-bit PNG become grey", "[image_decoder]") {
  std::vector<std::uint8_t> bytes;
  const cv::Mat colour = textured(CV_8UC3);
  cv::imencode(".png", colour, bytes);
  const std::vector<std::uint8_t> out = decoded(bytes);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const cv::Vec3b p = colour.at<cv::Vec3b>(i / kWidth, i % kWidth);
    // libpng's weights are Rec. 709's.
    const double grey = 0.0722 * p[0] + 0.7152 * p[1] + 0.2126 * p[2];
    REQUIRE(std::abs(out[static_cast<std::size_t>(i)] - grey) < 2.0);
  }
  cv::Mat black_white(kHeight, kWidth, CV_8UC1);
  for (int i = 0; i < kWidth * kHeight; ++i)
    black_white.at<std::uint8_t>(i / kWidth, i % kWidth) = (i % 3 == 0) ? 255 : 0;
  cv::imencode(".png", black_white, bytes, {cv::IMWRITE_PNG_BILEVEL, 1});
  CHECK(decoded(bytes) == pixelsOf(black_white));
}

TEST_CASE("JPEG gives the oracle's pixels", "[image_decoder]") {
  for (const int quality : {30, 90, 100}) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", textured(CV_8UC1), bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
    CHECK(decoded(bytes) == pixelsOf(cv::imdecode(bytes, cv::IMREAD_GRAYSCALE)));
    cv::imencode(".jpg", textured(CV_8UC1), bytes, {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
    CHECK(decoded(bytes) == pixelsOf(cv::imdecode(bytes, cv::IMREAD_GRAYSCALE)));
    cv::imencode(".jpg", textured(CV_8UC3), bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
    CHECK(decoded(bytes) == pixelsOf(cv::imdecode(bytes, cv::IMREAD_GRAYSCALE)));
  }
}

TEST_CASE("a picture cut anywhere is damaged, and the next one is decoded", "[image_decoder]") {
  for (const char* extension : {".png", ".jpg"}) {
    std::vector<std::uint8_t> whole;
    cv::imencode(extension, textured(CV_8UC1), whole);
    const std::vector<std::uint8_t> truth = pixelsOf(cv::imdecode(whole, cv::IMREAD_GRAYSCALE));
    ImageDecoder decoder;
    std::vector<std::uint8_t> out(kWidth * kHeight);
    ImageSize found;
    for (std::size_t n = 0; n + 2 < whole.size(); n += 1 + whole.size() / 200) {
      INFO(extension << " cut at " << n << " of " << whole.size());
      const DecodeResult cut =
          decoder.decode(std::span(whole).first(n), {kWidth, kHeight}, out.data(), found);
      CHECK((cut == DecodeResult::kDamaged || (n < 8 && cut == DecodeResult::kUnknownFormat)));
    }
    REQUIRE(decoder.decode(whole, {kWidth, kHeight}, out.data(), found) == DecodeResult::kOk);
    CHECK(out == truth);
  }
}

TEST_CASE("flipped bytes never write outside the picture", "[image_decoder]") {
  Random random(5);
  constexpr std::uint8_t kGuard = 0xA5;
  for (const char* extension : {".png", ".jpg"}) {
    std::vector<std::uint8_t> whole;
    cv::imencode(extension, textured(CV_8UC1), whole);
    ImageDecoder decoder;
    for (int round = 0; round < 300; ++round) {
      std::vector<std::uint8_t> bytes = whole;
      for (int k = 0; k < 3; ++k)
        bytes[random.below(static_cast<std::uint32_t>(bytes.size()))] ^=
            static_cast<std::uint8_t>(1U << random.below(8));
      std::vector<std::uint8_t> out(kWidth * kHeight + 64, kGuard);
      ImageSize found;
      (void)decoder.decode(bytes, {kWidth, kHeight}, out.data(), found);
      for (std::size_t i = kWidth * kHeight; i < out.size(); ++i) REQUIRE(out[i] == kGuard);
    }
  }
}

TEST_CASE("another size is told, with the size found", "[image_decoder]") {
  ImageDecoder decoder;
  ImageSize found;
  std::vector<std::uint8_t> out(64 * 48);
  for (const auto& bytes : {test::encodePng(test::pattern(32, 24, 0), 32, 24),
                            test::encodeJpeg(test::pattern(32, 24, 0), 32, 24)}) {
    CHECK(decoder.decode(bytes, {64, 48}, out.data(), found) == DecodeResult::kWrongSize);
    CHECK(found == ImageSize{32, 24});
  }
}

}  // namespace
}  // namespace swiftlet
