#include "io/page_cache.h"

#include <algorithm>
#include <new>

#include "io/mapped_pages.h"
#include "io/page_cache_state.h"
#include "io/ticks.h"

namespace shoal {
namespace {

/// Counts the time until it is gone.
class WaitedTime {
 public:
  explicit WaitedTime(CacheCounters& counters) : counters_(counters), start_(now_ticks()) {}
  ~WaitedTime() { counters_.waited_ticks += now_ticks() - start_; }
  WaitedTime(const WaitedTime&) = delete;
  WaitedTime& operator=(const WaitedTime&) = delete;

 private:
  CacheCounters& counters_;
  uint64_t start_;
};

}  // namespace

void CacheCounters::add(const CacheCounters& other) {
  page_requests_count += other.page_requests_count;
  page_hits_count += other.page_hits_count;
  page_misses_count += other.page_misses_count;
  page_prefetches_count += other.page_prefetches_count;
  page_evictions_count += other.page_evictions_count;
  disk_reads_count += other.disk_reads_count;
  disk_read_bytes += other.disk_read_bytes;
  decoded_bytes += other.decoded_bytes;
  treelet_loads_count += other.treelet_loads_count;
  treelet_load_bytes += other.treelet_load_bytes;
  attribute_loads_count += other.attribute_loads_count;
  texture_loads_count += other.texture_loads_count;
  waited_ticks += other.waited_ticks;
}

bool PageCache::State::try_pin(PageId page) {
  PageSlot& slot = slots[page];
  if ((slot.state.load(std::memory_order_relaxed) & kResident) == 0) return false;
  if ((slot.state.fetch_add(1, std::memory_order_acquire) & kResident) == 0) {
    release(page);
    return false;
  }
  // Most hits find their own stamp: a store each time would move the line between the cores.
  const uint64_t now = tick.load(std::memory_order_relaxed) | 1;
  if (slot.last_use.load(std::memory_order_relaxed) != now) slot.last_use.store(now, std::memory_order_relaxed);
  return true;
}

/// Sequentially consistent, as wait_for_room() is: either this thread sees the sleeper, or the sleeper sees the
/// unpin.
void PageCache::State::release(PageId page) {
  if (slots[page].state.fetch_sub(1) != (kResident | 1)) return;
  if (room_waiters.load() == 0) return;
  const std::lock_guard lock(mutex);
  unpinned.notify_all();
}

Status PageCache::State::load(PageId page, PageLoad& load, std::unique_lock<std::mutex>& lock,
                              CacheCounters& counters) {
  const uint32_t bytes = page_bytes(page);
  const Result<std::byte*> buffer = make_room(bytes, lock, counters);
  Status status;
  if (buffer.ok()) {
    lock.unlock();
    status = read(page, buffer.value(), counters);
    lock.lock();
  } else {
    status = buffer.error();
  }
  if (status.ok()) {
    publish(page, buffer.value(), 1 + load.waiting_threads);
  } else {
    load.error = status.error();
    if (buffer.ok()) {
      used_bytes -= PageBuffers::charge_bytes(bytes);
      buffers.keep(buffer.value(), bytes);
      unpinned.notify_all();
    }
  }
  load.done = true;
  loads.erase(page);
  loaded.notify_all();
  return status;
}

Status PageCache::State::read(PageId page, std::byte* data, CacheCounters& counters) const try {
  const PageRecord& record = file.record(page);
  const std::span<std::byte> bytes(data, record.raw_bytes);
  uint64_t read_bytes = 0;
  const Status status = file.read_page(page, bytes, &read_bytes);
  counters.disk_reads_count += read_bytes > 0 ? 1 : 0;
  counters.disk_read_bytes += read_bytes;
  if (!status.ok()) return status;
  return check_read(page, data, counters);
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kMemoryCap, "out of memory"};
}

/// Counts a page that has been read and decoded, and looks it over.
Status PageCache::State::check_read(PageId page, std::byte* data, CacheCounters& counters) const try {
  const PageRecord& record = file.record(page);
  PageBuffers::zero_tail(data, record.raw_bytes);
  counters.decoded_bytes += record.raw_bytes;
  counters.treelet_loads_count += record.kind == PageKind::kTreelet ? 1 : 0;
  counters.treelet_load_bytes += record.kind == PageKind::kTreelet ? record.raw_bytes : 0;
  counters.attribute_loads_count += record.kind == PageKind::kAttributes ? 1 : 0;
  counters.texture_loads_count += record.kind == PageKind::kTexture ? 1 : 0;
  // The checksum says that these are the bytes of the directory's page: once looked over, they stay good.
  if (!check || slots[page].checked.load(std::memory_order_relaxed)) return {};
  SHOAL_RETURN_IF_ERROR(check(record, {data, record.raw_bytes}));
  slots[page].checked.store(true, std::memory_order_relaxed);
  return {};
} catch (const std::bad_alloc&) {  // others wait for this page: they are told
  return Error{ErrorCode::kMemoryCap, "out of memory"};  // short: allocates nothing
}

void PageCache::State::publish(PageId page, std::byte* data, uint32_t pins) {
  PageSlot& slot = slots[page];
  slot.data = data;
  slot.place = static_cast<uint32_t>(residents.size());
  residents.push_back(page);
  const uint64_t now = tick.load(std::memory_order_relaxed) + 2;
  tick.store(now, std::memory_order_relaxed);
  slot.last_use.store(now, std::memory_order_relaxed);
  slot.state.fetch_add(kResident + pins, std::memory_order_release);
}

PageCache::PageCache(const PageFile& file, uint64_t capacity_bytes, PageCheck check, WaitingWork waiting,
                     const PagingOptions& paging)
    : state_(std::make_unique<State>(file, capacity_bytes, std::move(check), std::move(waiting), paging.eviction)) {
  SHOAL_CHECK(state_->eviction != nullptr);
  if (paging.read_depth == 0 || !state_->waiting) return;
  state_->loader = std::make_unique<PageLoader>(file, paging, [s = state_.get()](PageId page, std::byte* data, Status status,
                                                                                   PageLoader::ReadShare share) {
    s->finish_prefetch(page, data, std::move(status), share);
  });
}

PageCache::~PageCache() {
  state_->loader.reset();
  for (const PageId page : state_->residents) SHOAL_CHECK(state_->slots[page].state.load() == kResident);
}

uint64_t PageCache::minimum_capacity_bytes(const PageFile& file, unsigned threads) {
  uint64_t largest[256] = {}, pages[256] = {};
  for (const PageRecord& record : file.records()) {
    uint64_t& bytes = largest[static_cast<uint8_t>(record.kind)];
    if (record.kind != PageKind::kTable) bytes = std::max(bytes, PageBuffers::charge_bytes(record.raw_bytes));
    ++pages[static_cast<uint8_t>(record.kind)];
  }
  constexpr auto kTexture = static_cast<uint8_t>(PageKind::kTexture);
  largest[kTexture] *= std::min<uint64_t>(pages[kTexture], kPinnedTilesPerThread);
  uint64_t sum = 0;
  for (const uint64_t bytes : largest) sum += bytes;
  return sum * threads;
}

uint64_t PageCache::every_page_bytes(const PageFile& file) {
  uint64_t sum = 0;
  for (const PageRecord& record : file.records()) {
    if (record.kind != PageKind::kTable) sum += PageBuffers::charge_bytes(record.raw_bytes);
  }
  return sum;
}

uint64_t PageCache::overhead_bytes(const PageFile& file, const PagingOptions& paging) {
  // A vector that grows holds up to twice what it needs.
  return file.page_count() * (sizeof(PageSlot) + 2 * sizeof(PageId) + 2 * sizeof(EvictionCandidate)) +
         PageLoader::buffer_bytes(file, paging);
}

Result<PagePin> PageCache::pin(PageId page, CacheCounters& counters) {
  State& s = *state_;
  SHOAL_CHECK(page < s.file.page_count());
  counters.page_requests_count += 1;
  if (s.mapped != nullptr) {
    counters.page_hits_count += 1;
    return PagePin(*this, page, s.mapped->bytes(page).data(), s.page_bytes(page));
  }
  if (s.try_pin(page)) {
    counters.page_hits_count += 1;
    return PagePin(*this, page, s.slots[page].data, s.page_bytes(page));
  }
  const WaitedTime waited(counters);
  std::unique_lock lock(s.mutex);
  for (auto under_way = s.loads.find(page); under_way != s.loads.end(); under_way = s.loads.find(page)) {
    const std::shared_ptr<PageLoad> load = under_way->second;
    load->waiting_threads += 1;
    s.loaded.wait(lock, [&] { return load->done; });
    if (load->abandoned) continue;
    counters.page_hits_count += 1;
    if (load->error) return *load->error;
    return PagePin(*this, page, s.slots[page].data, s.page_bytes(page));
  }
  if (s.try_pin(page)) {
    counters.page_hits_count += 1;
  } else {
    counters.page_misses_count += 1;
    const auto load = std::make_shared<PageLoad>();
    s.loads.emplace(page, load);
    SHOAL_RETURN_IF_ERROR(s.load(page, *load, lock, counters));
  }
  return PagePin(*this, page, s.slots[page].data, s.page_bytes(page));
}

void PageCache::unpin(PageId page) {
  if (state_->mapped == nullptr) state_->release(page);
}

void PageCache::serve_from(const MappedPages* pages) { state_->mapped = pages; }

bool PageCache::resident(PageId page) const {
  return state_->mapped != nullptr || (state_->slots[page].state.load(std::memory_order_relaxed) & kResident) != 0;
}

uint64_t PageCache::resident_bytes() const { return state_->held_bytes.load(std::memory_order_relaxed); }
uint64_t PageCache::peak_resident_bytes() const { return state_->peak_bytes.load(std::memory_order_relaxed); }
uint64_t PageCache::capacity_bytes() const { return state_->capacity_bytes; }

PagePin::PagePin(PageCache& cache, PageId page, const std::byte* data, uint32_t size)
    : cache_(&cache), data_(data), size_(size), page_(page) {}

PagePin::PagePin(PagePin&& other) noexcept { *this = std::move(other); }

PagePin& PagePin::operator=(PagePin&& other) noexcept {
  if (this == &other) return *this;
  reset();
  cache_ = std::exchange(other.cache_, nullptr);
  data_ = std::exchange(other.data_, nullptr);
  size_ = std::exchange(other.size_, 0);
  page_ = std::exchange(other.page_, kNoPage);
  return *this;
}

PagePin::~PagePin() { reset(); }

void PagePin::reset() {
  if (cache_ != nullptr) cache_->unpin(page_);
  cache_ = nullptr;
  data_ = nullptr;
  size_ = 0;
  page_ = kNoPage;
}

}  // namespace shoal
