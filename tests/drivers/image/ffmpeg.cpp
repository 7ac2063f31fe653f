#include "tests/drivers/image/ffmpeg.hpp"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/imgutils.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

namespace swiftlet::ffmpeg {
namespace {

struct Free {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(SwsContext* context) const { sws_freeContext(context); }
};
template <typename T>
using Owned = std::unique_ptr<T, Free>;

AVPixelFormat formatOf(const std::string& name) {
  const AVPixelFormat format = av_get_pix_fmt(name.c_str());
  INFO(name);
  REQUIRE(format != AV_PIX_FMT_NONE);
  return format;
}

Owned<AVFrame> emptyFrame(int width, int height, AVPixelFormat format) {
  Owned<AVFrame> frame(av_frame_alloc());
  frame->width = width;
  frame->height = height;
  frame->format = format;
  REQUIRE(av_frame_get_buffer(frame.get(), 0) == 0);
  return frame;
}

Owned<AVFrame> converted(const Picture& from, AVPixelFormat format) {
  av_log_set_level(AV_LOG_ERROR);  // it would have full-range formats declared otherwise
  Owned<AVFrame> frame = emptyFrame(from.width, from.height, format);
  const Owned<SwsContext> scaler(sws_getContext(
      from.width, from.height, AV_PIX_FMT_RGB24, from.width, from.height, format,
      SWS_POINT | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP | SWS_BITEXACT, nullptr, nullptr, nullptr));
  REQUIRE(scaler);
  const std::array<const std::uint8_t*, 1> rows = {from.rgb.data()};
  const std::array<int, 1> strides = {3 * from.width};
  REQUIRE(sws_scale(scaler.get(), rows.data(), strides.data(), 0, from.height, frame->data,
                    frame->linesize) == from.height);
  return frame;
}

}  // namespace

Picture picture(int width, int height) {
  Picture made{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      constexpr double kWave = 9;  // px
      const double texture = 12 * std::sin(x / kWave) * std::cos(y / kWave);
      const double across = 200.0 * x / width;
      const double down = 180.0 * y / height;
      for (const double level : {30 + across, 40 + down, 230 - across}) {
        made.rgb.push_back(static_cast<std::uint8_t>(std::lround(std::clamp(level + texture, 0.0, 255.0))));
      }
    }
  }
  return made;
}

std::vector<std::uint8_t> as(const Picture& from, const std::string& name) {
  const AVPixelFormat format = formatOf(name);
  const Owned<AVFrame> frame = converted(from, format);
  std::vector<std::uint8_t> bytes(
      static_cast<std::size_t>(av_image_get_buffer_size(format, from.width, from.height, 1)));
  REQUIRE(av_image_copy_to_buffer(bytes.data(), static_cast<int>(bytes.size()), frame->data, frame->linesize,
                                  format, from.width, from.height, 1) > 0);
  return bytes;
}

std::vector<std::uint8_t> jpeg(const Picture& from, const std::string& name, int quality) {
  const AVPixelFormat format = formatOf(name);
  const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_MJPEG);
  REQUIRE(codec != nullptr);
  const Owned<AVCodecContext> context(avcodec_alloc_context3(codec));
  context->width = from.width;
  context->height = from.height;
  context->pix_fmt = format;
  context->color_range = AVCOL_RANGE_JPEG;
  context->time_base = {1, 20};
  context->flags |= AV_CODEC_FLAG_QSCALE;
  context->global_quality = quality * FF_QP2LAMBDA;
  REQUIRE(av_opt_set(context->priv_data, "huffman", "default", 0) == 0);
  REQUIRE(avcodec_open2(context.get(), codec, nullptr) == 0);
  const Owned<AVFrame> frame = converted(from, format);
  frame->quality = context->global_quality;
  frame->pts = 0;
  REQUIRE(avcodec_send_frame(context.get(), frame.get()) == 0);
  REQUIRE(avcodec_send_frame(context.get(), nullptr) == 0);
  const Owned<AVPacket> packet(av_packet_alloc());
  REQUIRE(avcodec_receive_packet(context.get(), packet.get()) == 0);
  return {packet->data, packet->data + packet->size};
}

std::vector<std::uint8_t> luma(const std::vector<std::uint8_t>& bytes) {
  const AVCodec* codec = avcodec_find_decoder(AV_CODEC_ID_MJPEG);
  const Owned<AVCodecContext> context(avcodec_alloc_context3(codec));
  context->idct_algo = FF_IDCT_INT;
  REQUIRE(avcodec_open2(context.get(), codec, nullptr) == 0);
  const Owned<AVPacket> packet(av_packet_alloc());
  REQUIRE(av_new_packet(packet.get(), static_cast<int>(bytes.size())) == 0);
  std::copy(bytes.begin(), bytes.end(), packet->data);
  REQUIRE(avcodec_send_packet(context.get(), packet.get()) == 0);
  REQUIRE(avcodec_send_packet(context.get(), nullptr) == 0);
  const Owned<AVFrame> frame(av_frame_alloc());
  REQUIRE(avcodec_receive_frame(context.get(), frame.get()) == 0);
  std::vector<std::uint8_t> out;
  for (int y = 0; y < frame->height; ++y) {
    const std::uint8_t* row = frame->data[0] + static_cast<std::ptrdiff_t>(y) * frame->linesize[0];
    out.insert(out.end(), row, row + frame->width);
  }
  return out;
}

}  // namespace swiftlet::ffmpeg
