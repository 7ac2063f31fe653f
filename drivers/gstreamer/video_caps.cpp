#include "drivers/gstreamer/video_caps.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace swiftlet {
namespace {

struct Pair {
  GstVideoFormat format;
  std::string_view letters;
};

constexpr std::array kPairs = {
    Pair{GST_VIDEO_FORMAT_GRAY8, "GREY"}, Pair{GST_VIDEO_FORMAT_GRAY16_LE, "Y16 "},
    Pair{GST_VIDEO_FORMAT_NV12, "NV12"},  Pair{GST_VIDEO_FORMAT_NV21, "NV21"},
    Pair{GST_VIDEO_FORMAT_I420, "YU12"},  Pair{GST_VIDEO_FORMAT_YV12, "YV12"},
    Pair{GST_VIDEO_FORMAT_NV16, "NV16"},  Pair{GST_VIDEO_FORMAT_Y42B, "422P"},
    Pair{GST_VIDEO_FORMAT_YUY2, "YUYV"},  Pair{GST_VIDEO_FORMAT_YVYU, "YVYU"},
    Pair{GST_VIDEO_FORMAT_UYVY, "UYVY"},  Pair{GST_VIDEO_FORMAT_VYUY, "VYUY"},
    Pair{GST_VIDEO_FORMAT_RGB, "RGB3"},   Pair{GST_VIDEO_FORMAT_BGR, "BGR3"},
    Pair{GST_VIDEO_FORMAT_RGBA, "AB24"},  Pair{GST_VIDEO_FORMAT_RGBx, "XB24"},
    Pair{GST_VIDEO_FORMAT_BGRA, "AR24"},  Pair{GST_VIDEO_FORMAT_BGRx, "XR24"},
};

GstStructure* anySize() {
  GValue formats = G_VALUE_INIT;
  GValue one = G_VALUE_INIT;
  g_value_init(&formats, GST_TYPE_LIST);
  g_value_init(&one, G_TYPE_STRING);
  for (const Pair& pair : kPairs) {
    g_value_set_static_string(&one, gst_video_format_to_string(pair.format));
    gst_value_list_append_value(&formats, &one);
  }
  GstStructure* structure = gst_structure_new_empty("video/x-raw");
  gst_structure_take_value(structure, "format", &formats);
  g_value_unset(&one);
  return structure;
}

}  // namespace

std::optional<PixelFormat> pixelFormatOf(GstVideoFormat format) {
  const auto* pair = std::ranges::find(kPairs, format, &Pair::format);
  return pair == kPairs.end() ? std::nullopt : pixelFormat(pair->letters);
}

GstCaps* acceptedCaps(int width, int height, double rate) {
  GstCaps* caps = gst_caps_new_empty();
  GstStructure* any = anySize();
  GstStructure* sized = gst_structure_copy(any);
  gst_structure_set(sized, "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, nullptr);
  if (rate > 0) {
    int numerator = 0;
    int denominator = 1;
    gst_util_double_to_fraction(rate, &numerator, &denominator);
    GstStructure* paced = gst_structure_copy(sized);
    gst_structure_set(paced, "framerate", GST_TYPE_FRACTION, numerator, denominator, nullptr);
    gst_caps_append_structure(caps, paced);
  }
  gst_caps_append_structure(caps, sized);
  gst_caps_append_structure(caps, any);
  return caps;
}

}  // namespace swiftlet
