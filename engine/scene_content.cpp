#include "engine/scene_content.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <span>

#include "engine/find_scenes.h"
#include "engine/named_files.h"
#include "io/aligned_buffer.h"
#include "io/content_hash.h"
#include "io/glb.h"
#include "io/page_file.h"
#include "io/uri.h"

namespace shoal {
namespace {

constexpr uint64_t kHashBlockBytes = 1u << 20;
/// A file written to so shortly before it was looked at may be written to again without its time changing: clocks of file
/// systems tick every 2 s at worst (FAT).
constexpr int64_t kClockTickNs = 2'000'000'000;

int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

class SceneHasher {
 public:
  SceneHasher(FileSystem& fs, const SceneContent* earlier, const std::atomic<bool>* stop)
      : fs_(fs), earlier_(earlier), stop_(stop) {
    content_.looked_ns = now_ns();
  }

  Result<SceneContent> run(const std::string& scene, const std::vector<std::string>& option_files) {
    SHOAL_RETURN_IF_ERROR(add_scene(scene));
    for (const std::string& path : option_files) SHOAL_RETURN_IF_ERROR(add(path));
    ContentHash hash;
    for (const HashedFile& file : content_.files) {
      hash.add_number(file.missing);
      hash.add_number(file.hash);
      hash.add_number(file.bytes);
    }
    content_.hash = hash.value();
    return std::move(content_);
  }

 private:
  /// The file as it was hashed before, if it looks as it did then.
  const HashedFile* unchanged(const HashedFile& now) const {
    if (earlier_ == nullptr || now.missing || now.modified_ns + kClockTickNs > earlier_->looked_ns) return nullptr;
    const auto& files = earlier_->files;
    const auto at = std::find_if(files.begin(), files.end(), [&](const HashedFile& f) { return f.path == now.path; });
    const bool same = at != files.end() && !at->missing && at->bytes == now.bytes && at->modified_ns == now.modified_ns;
    return same ? &*at : nullptr;
  }

  Status add_scene(const std::string& path) {
    const auto opened = fs_.open(path, ReadMode::kDirect);
    if (!opened.ok()) return add_missing(path);
    ReadableFile& file = *opened.value();
    if (is_shoal_path(path)) return add_shoal(path, file);
    gltf::FileRange json{0, file.size_bytes()};
    if (const auto chunks = gltf::find_glb_chunks(file); chunks.ok() && chunks.value()) json = chunks.value()->json;
    NamedFiles names;
    SHOAL_RETURN_IF_ERROR(read(file, json, [&](std::span<const std::byte> bytes) {
      names.add({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }));
    SHOAL_RETURN_IF_ERROR(add(path));
    const size_t slash = path.rfind('/');
    const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash);
    std::set<std::string> seen{path};
    for (const std::string& uri : names.uris()) {
      const auto part = resolve_uri(folder, uri);
      if (part.ok() && seen.insert(part.value()).second) SHOAL_RETURN_IF_ERROR(add(part.value()));
    }
    return {};
  }

  /// By its directory; bytes that belong to no .shoal are hashed as any others.
  Status add_shoal(const std::string& path, const ReadableFile& file) {
    const auto pages = PageFile::open(fs_, path, ReadMode::kDirect);
    if (!pages.ok()) return add(path);
    ContentHash hash;
    hash.add(std::as_bytes(pages.value()->records()));
    content_.files.push_back({path, false, file.size_bytes(), file.modified_ns(), hash.value()});
    return {};
  }

  Status add_missing(const std::string& path) {
    content_.files.push_back({path, true, 0, 0, 0});
    return {};
  }

  Status add(const std::string& path) {
    const auto opened = fs_.open(path, ReadMode::kDirect);
    if (!opened.ok()) return add_missing(path);
    ReadableFile& file = *opened.value();
    HashedFile now{path, false, file.size_bytes(), file.modified_ns(), 0};
    if (const HashedFile* before = unchanged(now)) {
      now.hash = before->hash;
    } else {
      ContentHash hash;
      SHOAL_RETURN_IF_ERROR(read(file, {0, now.bytes}, [&](std::span<const std::byte> bytes) { hash.add(bytes); }));
      now.hash = hash.value();
      content_.anew = true;
    }
    content_.files.push_back(std::move(now));
    return {};
  }

  template <class Use>
  Status read(ReadableFile& file, gltf::FileRange range, const Use& use) {
    SHOAL_ASSIGN_OR_RETURN(const std::span<std::byte> block, block_.reserve(kHashBlockBytes));
    while (range.bytes > 0) {
      if (stop_ != nullptr && stop_->load()) return Error{ErrorCode::kStopped, "stopped"};
      const std::span<std::byte> part = block.first(std::min(range.bytes, kHashBlockBytes));
      SHOAL_RETURN_IF_ERROR(file.read_at(range.offset, part));
      use(part);
      range.offset += part.size();
      range.bytes -= part.size();
    }
    return {};
  }

  FileSystem& fs_;
  const SceneContent* earlier_;
  const std::atomic<bool>* stop_;
  AlignedBuffer block_;
  SceneContent content_;
};

}  // namespace

Result<SceneContent> hash_scene(FileSystem& fs, const std::string& scene, const std::vector<std::string>& option_files,
                                const SceneContent* earlier, const std::atomic<bool>* stop) {
  return SceneHasher(fs, earlier, stop).run(scene, option_files);
}

bool looks_unchanged(FileSystem& fs, const SceneContent& content) {
  return std::all_of(content.files.begin(), content.files.end(), [&](const HashedFile& before) {
    const auto file = fs.open(before.path, ReadMode::kBuffered);
    if (!file.ok()) return before.missing;
    return !before.missing && file.value()->size_bytes() == before.bytes &&
           file.value()->modified_ns() == before.modified_ns;
  });
}

}  // namespace shoal
