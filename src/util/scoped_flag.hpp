// Sets a flag while a function or a coroutine executes, also while the coroutine is suspended.
#pragma once

namespace margay {

class ScopedFlag {
  public:
    explicit ScopedFlag(bool& flag) : flag_(flag) { flag_ = true; }
    ScopedFlag(const ScopedFlag&) = delete;
    ScopedFlag& operator=(const ScopedFlag&) = delete;
    ~ScopedFlag() { flag_ = false; }

  private:
    bool& flag_;
};

}  // namespace margay
