#include "io/page_loader.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "io/aligned_buffer.h"
#include "io/async_reader.h"

namespace shoal {
namespace {

/// Threads of the pread pool: enough reads at once to keep one drive busy (docs/design.md, "Numbers to know").
constexpr unsigned kReadThreads = 8;

std::unique_ptr<AsyncReader> make_reader(const PageFile& file, const PagingOptions& options) {
  if (options.backend != ReadBackend::kThreads && file.file().descriptor() >= 0) {
    if (auto reader = make_uring_reader(options.read_depth)) return reader;
  }
  return make_thread_reader(options.read_depth, std::min(options.read_depth, kReadThreads));
}

uint64_t largest_stored_bytes(const PageFile& file) {
  uint64_t largest = kBlockBytes;
  for (const PageRecord& record : file.records()) {
    if (record.kind != PageKind::kTable) largest = std::max(largest, align_up(record.stored_bytes, kBlockBytes));
  }
  return largest;
}

}  // namespace

struct PageLoader::State {
  struct Slot {
    PageId page = kNoPage;
    std::byte* out = nullptr;
    std::span<std::byte> stored;
  };

  State(const PageFile& page_file, const PagingOptions& options, Finished done)
      : file(page_file), finished(std::move(done)), slot_bytes(largest_stored_bytes(page_file)), slots(options.read_depth) {
    for (uint32_t i = options.read_depth; i-- > 0;) free_slots.push_back(i);
    reader = make_reader(file, options);
  }

  /// One thread: verifies and decodes until it is woken at the end.
  void serve() {
    while (auto completion = reader->wait()) {
      const Slot slot = slots[completion->tag];
      Status status = std::move(completion->status);
      if (status.ok()) {
        status = file.decode_page(slot.page, slot.stored, {slot.out, file.record(slot.page).raw_bytes});
      }
      {
        const std::lock_guard lock(mutex);
        free_slots.push_back(completion->tag);
      }
      finished(slot.page, slot.out, std::move(status));
      under_way.fetch_sub(1);
      under_way.notify_all();
    }
  }

  const PageFile& file;
  const Finished finished;
  const uint64_t slot_bytes;
  std::atomic<uint32_t> under_way{0};
  std::mutex mutex;  // guards free_slots
  std::vector<uint32_t> free_slots;
  std::vector<Slot> slots;
  AlignedBuffer buffers;
  std::unique_ptr<AsyncReader> reader;
  std::vector<std::thread> threads;
};

PageLoader::PageLoader(const PageFile& file, const PagingOptions& options, Finished finished)
    : state_(std::make_unique<State>(file, options, std::move(finished))) {
  State& s = *state_;
  const auto memory = s.buffers.reserve(s.slot_bytes * s.slots.size());
  if (!memory.ok()) {  // every page is then read by the thread that wants it
    s.free_slots.clear();
    return;
  }
  for (size_t i = 0; i < s.slots.size(); ++i) s.slots[i].stored = memory.value().subspan(i * s.slot_bytes, s.slot_bytes);
  for (unsigned i = 0; i < std::max(1u, options.loader_threads); ++i) s.threads.emplace_back([&s] { s.serve(); });
}

PageLoader::~PageLoader() {
  State& s = *state_;
  finish();
  for (size_t i = 0; i < s.threads.size(); ++i) s.reader->wake();
  for (std::thread& thread : s.threads) thread.join();
}

bool PageLoader::try_start(PageId page, std::byte* out) {
  State& s = *state_;
  uint32_t tag = 0;
  {
    const std::lock_guard lock(s.mutex);
    if (s.free_slots.empty()) return false;
    tag = s.free_slots.back();
    s.free_slots.pop_back();
  }
  s.under_way.fetch_add(1);
  State::Slot& slot = s.slots[tag];
  const StoredRange range = s.file.stored_range(page);
  slot.page = page;
  slot.out = out;
  slot.stored = {slot.stored.data(), range.bytes};
  s.reader->submit({&s.file.file(), range.offset, slot.stored, tag});
  return true;
}

void PageLoader::finish() {
  std::atomic<uint32_t>& count = state_->under_way;
  for (uint32_t left = count.load(); left > 0; left = count.load()) count.wait(left);
}

bool PageLoader::full() const {
  const std::lock_guard lock(state_->mutex);
  return state_->free_slots.empty();
}

unsigned PageLoader::under_way() const { return state_->under_way.load(); }
const char* PageLoader::backend() const { return state_->reader->name(); }

uint64_t PageLoader::buffer_bytes(const PageFile& file, const PagingOptions& options) {
  return options.read_depth == 0 ? 0 : largest_stored_bytes(file) * options.read_depth + (1u << 20);
}

}  // namespace shoal
