#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/import/video_file.hpp"

namespace swiftlet {

struct VideoFile::Codec {};

VideoFile::VideoFile(const std::string& path) {
  throw InputError(path, 0, "", "this build cannot read videos",
                   "Build swiftlet with libavformat-dev and libavcodec-dev installed");
}

VideoFile::~VideoFile() = default;
int VideoFile::width() const { return 0; }
int VideoFile::height() const { return 0; }
std::uint64_t VideoFile::pictures() const { return 0; }
double VideoFile::rate() const { return 0; }
std::vector<MetadataPacket> VideoFile::metadata() { return {}; }
bool VideoFile::nextFrame(VideoFrame& /*frame*/) { return false; }
bool canReadVideos() { return false; }

}  // namespace swiftlet
