#include "firmware_host/lab/import/video_file.hpp"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr AVRational kNanoseconds = {1, 1'000'000'000};
constexpr unsigned kGreyBits = 8;

std::string reason(int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(error, text.data(), text.size());
  return text.data();
}

Duration since(std::int64_t time, const AVStream& stream) {
  return {av_rescale_q(time, stream.time_base, kNanoseconds)};
}

}  // namespace

struct VideoFile::Codec {
  struct Free {
    void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
    void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
    void operator()(AVFrame* frame) const { av_frame_free(&frame); }
    void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  };

  template <typename T>
  using Owned = std::unique_ptr<T, Free>;

  Owned<AVFormatContext> file;
  Owned<AVCodecContext> decoder;
  Owned<AVFrame> frame{av_frame_alloc()};
  Owned<AVPacket> packet{av_packet_alloc()};
  AVStream* video = nullptr;
  AVStream* metadata = nullptr;
  bool ended = false;
};

bool canReadVideos() { return true; }

VideoFile::VideoFile(const std::string& path) : path_(path), codec_(std::make_unique<Codec>()) {
  av_log_set_level(AV_LOG_QUIET);  // errors are returned as values
  AVFormatContext* opened = nullptr;
  int result = avformat_open_input(&opened, path.c_str(), nullptr, nullptr);
  codec_->file.reset(opened);
  if (result == 0) result = avformat_find_stream_info(opened, nullptr);
  if (result < 0) {
    throw InputError(path, 0, "", "cannot be read as a video: " + reason(result),
                     "Give a complete video file; an interrupted recording has no index");
  }
  const AVCodec* codec = nullptr;
  const int index = av_find_best_stream(opened, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
  if (index < 0 || codec == nullptr) {
    throw InputError(path, 0, "", "holds no video that FFmpeg can decode", "`ffprobe` shows its contents");
  }
  for (unsigned i = 0; i < opened->nb_streams; ++i) {
    AVStream* stream = opened->streams[i];
    if (static_cast<int>(i) == index) codec_->video = stream;
    if (stream->codecpar->codec_tag == MKTAG('g', 'p', 'm', 'd')) codec_->metadata = stream;
  }
  codec_->decoder.reset(avcodec_alloc_context3(codec));
  AVCodecContext* decoder = codec_->decoder.get();
  result = avcodec_parameters_to_context(decoder, codec_->video->codecpar);
  if (result >= 0) result = avcodec_open2(decoder, codec, nullptr);
  if (result < 0) throw InputError(path, 0, "", "cannot be decoded: " + reason(result), "");
}

VideoFile::~VideoFile() = default;

int VideoFile::width() const { return codec_->video->codecpar->width; }
int VideoFile::height() const { return codec_->video->codecpar->height; }
std::uint64_t VideoFile::pictures() const {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(codec_->video->nb_frames, 0));
}
double VideoFile::rate() const {
  const AVRational rate = codec_->video->avg_frame_rate;
  return rate.den > 0 ? av_q2d(rate) : 0;
}

std::vector<MetadataPacket> VideoFile::metadata() {
  std::vector<MetadataPacket> packets;
  if (codec_->metadata == nullptr) return packets;
  AVFormatContext* file = codec_->file.get();
  AVPacket* packet = codec_->packet.get();
  codec_->video->discard = AVDISCARD_ALL;
  while (av_read_frame(file, packet) >= 0) {
    if (packet->stream_index == codec_->metadata->index && packet->pts != AV_NOPTS_VALUE) {
      packets.push_back({since(packet->pts, *codec_->metadata),
                         since(packet->duration, *codec_->metadata),
                         {packet->data, packet->data + packet->size}});
    }
    av_packet_unref(packet);
  }
  codec_->video->discard = AVDISCARD_DEFAULT;
  const int result = av_seek_frame(file, codec_->video->index, 0, AVSEEK_FLAG_BACKWARD);
  if (result < 0) throw InputError(path_, 0, "", "cannot be rewound: " + reason(result), "");
  return packets;
}

/// Decodes the next image into `frame`; false at the end.
bool VideoFile::receive() {
  AVCodecContext* decoder = codec_->decoder.get();
  AVPacket* packet = codec_->packet.get();
  for (;;) {
    const int result = avcodec_receive_frame(decoder, codec_->frame.get());
    if (result == 0) return true;
    if (result == AVERROR_EOF || (codec_->ended && result != AVERROR(EAGAIN))) return false;
    if (result != AVERROR(EAGAIN)) ++damaged_;
    if (av_read_frame(codec_->file.get(), packet) < 0) {
      if (codec_->ended) return false;
      codec_->ended = true;
      static_cast<void>(avcodec_send_packet(decoder, nullptr));  // flushes the images that it still holds
      continue;
    }
    if (packet->stream_index == codec_->video->index && avcodec_send_packet(decoder, packet) < 0) ++damaged_;
    av_packet_unref(packet);
  }
}

bool VideoFile::nextFrame(VideoFrame& frame) {
  const AVFrame& picture = *codec_->frame;
  do {
    if (!receive()) return false;
    if (picture.best_effort_timestamp == AV_NOPTS_VALUE || picture.decode_error_flags != 0) ++damaged_;
  } while (picture.best_effort_timestamp == AV_NOPTS_VALUE || picture.decode_error_flags != 0);
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  const AVComponentDescriptor luma = format == nullptr ? AVComponentDescriptor{} : format->comp[0];
  const bool grey = format != nullptr &&
                    (format->flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_HWACCEL |
                                      AV_PIX_FMT_FLAG_BE)) == 0 &&
                    luma.plane == 0 && luma.offset == 0 && luma.step == (luma.depth > 8 ? 2 : 1);
  if (!grey) {
    throw InputError(path_, 0, "",
                     fmt::format("its pixels are {}", format == nullptr ? "unknown" : format->name),
                     "Convert it: `ffmpeg -i VIDEO -pix_fmt yuv420p -c:v ffv1 NEW.mkv`");
  }
  frame.time = since(picture.best_effort_timestamp, *codec_->video);
  if (luma.depth == static_cast<int>(kGreyBits)) {
    frame.image = {picture.data[0], picture.width, picture.height, picture.linesize[0]};
    return true;
  }
  const unsigned shift = static_cast<unsigned>(luma.shift + luma.depth) - kGreyBits;
  grey_.resize(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
  std::uint8_t* out = grey_.data();
  for (int y = 0; y < picture.height; ++y) {
    const std::uint8_t* row = picture.data[0] + static_cast<std::ptrdiff_t>(y) * picture.linesize[0];
    for (int x = 0; x < picture.width; ++x) {
      std::uint16_t word = 0;
      std::memcpy(&word, row + 2 * x, sizeof(word));
      *out++ = static_cast<std::uint8_t>(word >> shift);
    }
  }
  frame.image = {grey_.data(), picture.width, picture.height, picture.width};
  return true;
}

}  // namespace swiftlet
