#include "tests/drivers/gstreamer/feed_element.hpp"

#include <gst/base/gstpushsrc.h>
#include <gst/gst.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <thread>

namespace swiftlet::test {
namespace {

std::array<std::atomic<Feed*>, 2> g_feeds = {};

struct FeedSource {
  GstPushSrc parent;
  int feed;
  std::atomic<bool> unlocked;
};
struct FeedSourceClass {
  GstPushSrcClass parent;
};

void pause() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

Feed* feedOf(const FeedSource& source) { return g_feeds.at(static_cast<std::size_t>(source.feed)).load(); }

extern "C" {

static GType feedSourceType();

static gboolean start(GstBaseSrc* base) {
  const auto& self = *reinterpret_cast<FeedSource*>(base);
  for (Feed* feed = feedOf(self); feed != nullptr && feed->startHangs();) pause();
  return TRUE;
}

static gboolean unlock(GstBaseSrc* base) {
  reinterpret_cast<FeedSource*>(base)->unlocked.store(true);
  return TRUE;
}
static gboolean unlockStop(GstBaseSrc* base) {
  reinterpret_cast<FeedSource*>(base)->unlocked.store(false);
  return TRUE;
}

static GstFlowReturn create(GstPushSrc* push, GstBuffer** out) {
  auto& self = *reinterpret_cast<FeedSource*>(push);
  FedImage image;
  Feed::Next next = Feed::Next::kWait;
  while (next == Feed::Next::kWait) {
    if (self.unlocked.load()) return GST_FLOW_FLUSHING;
    Feed* feed = feedOf(self);
    if (feed != nullptr) next = feed->next(image);
    if (next == Feed::Next::kWait) pause();
  }
  if (next == Feed::Next::kEnd) return GST_FLOW_EOS;
  if (next == Feed::Next::kError) {
    GST_ELEMENT_ERROR(push, RESOURCE, READ, ("The camera went away."), (nullptr));
    return GST_FLOW_ERROR;
  }
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, image.bytes.size(), nullptr);
  gst_buffer_fill(buffer, 0, image.bytes.data(), image.bytes.size());
  if (image.capture) {
    GST_BUFFER_PTS(buffer) =
        static_cast<GstClockTime>(image.capture->ns) - gst_element_get_base_time(GST_ELEMENT(push));
  }
  if (image.number) GST_BUFFER_OFFSET(buffer) = *image.number;
  if (image.damaged) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_CORRUPTED);
  *out = buffer;
  return GST_FLOW_OK;
}

static void setProperty(GObject* object, guint /*id*/, const GValue* value, GParamSpec* /*spec*/) {
  reinterpret_cast<FeedSource*>(object)->feed = g_value_get_int(value);
}

static void initClass(void* klass, void* /*data*/) {
  G_OBJECT_CLASS(klass)->set_property = setProperty;
  g_object_class_install_property(G_OBJECT_CLASS(klass), 1,
                                  g_param_spec_int("feed", "feed", "Which feed", 0, 1, 0, G_PARAM_WRITABLE));
  GST_BASE_SRC_CLASS(klass)->start = start;
  GST_BASE_SRC_CLASS(klass)->unlock = unlock;
  GST_BASE_SRC_CLASS(klass)->unlock_stop = unlockStop;
  GST_PUSH_SRC_CLASS(klass)->create = create;
  static GstStaticPadTemplate source_pad =
      GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &source_pad);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Feed", "Source/Video", "A test's images",
                                        "swiftlet");
}

static void initOne(GTypeInstance* instance, void* /*klass*/) {
  gst_base_src_set_live(GST_BASE_SRC(instance), TRUE);
  gst_base_src_set_format(GST_BASE_SRC(instance), GST_FORMAT_TIME);
}

static GType feedSourceType() {
  static const GType kType =
      g_type_register_static_simple(GST_TYPE_PUSH_SRC, "SwiftletFeedSource", sizeof(FeedSourceClass),
                                    initClass, sizeof(FeedSource), initOne, GTypeFlags{});
  return kType;
}

}  // extern "C"

}  // namespace

void setFeed(int feed, Feed* what) {
  static const bool kKnown = [] {
    gst_init(nullptr, nullptr);
    return gst_element_register(nullptr, "feedsrc", GST_RANK_NONE, feedSourceType()) == TRUE;
  }();
  g_feeds.at(static_cast<std::size_t>(feed)).store(kKnown ? what : nullptr);
}

}  // namespace swiftlet::test
