#include "firmware_host/outputs/view/picture_coder.hpp"

#include <turbojpeg.h>

#include <algorithm>

#include "firmware_host/outputs/page/base64.hpp"

namespace swiftlet {

class PictureCoder::Coder {
 public:
  Coder() : handle(tjInitCompress()) {}
  ~Coder() {
    tjFree(bytes);
    if (handle != nullptr) tjDestroy(handle);
  }
  Coder(const Coder&) = delete;
  Coder& operator=(const Coder&) = delete;

  tjhandle handle;
  unsigned char* bytes = nullptr;  ///< owned by the library; grows with the pictures
  unsigned long size = 0;          // NOLINT(google-runtime-int): the library's type
};

PictureCoder::PictureCoder() : coder_(std::make_unique<Coder>()) {}
PictureCoder::~PictureCoder() = default;

/// Reduces the image by taking the mean of each square of n x n pixels.
ImageView PictureCoder::reduced(const ImageView& image, int most_width) {
  const int n = (image.width + most_width - 1) / most_width;
  if (n <= 1) return image;
  const int width = image.width / n;
  const int height = image.height / n;
  small_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::uint8_t* to = small_.data();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int sum = 0;
      for (int j = 0; j < n; ++j) {
        const std::uint8_t* row = image.row(y * n + j) + x * n;
        for (int i = 0; i < n; ++i) sum += row[i];
      }
      *to++ = static_cast<std::uint8_t>(sum / (n * n));
    }
  }
  return {small_.data(), width, height, width};
}

std::string PictureCoder::encode(const ImageView& image, const PictureSize& size) {
  if (image.empty() || coder_->handle == nullptr) return {};
  const ImageView small = reduced(image, size.most_width);
  if (tjCompress2(coder_->handle, small.data, small.width, small.stride, small.height, TJPF_GRAY,
                  &coder_->bytes, &coder_->size, TJSAMP_GRAY, size.quality, 0) != 0) {
    return {};
  }
  return "data:image/jpeg;base64," + base64({coder_->bytes, coder_->size});
}

}  // namespace swiftlet
