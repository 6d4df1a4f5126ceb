// A flag that is set while a function executes, or while a coroutine does, also when it is suspended.
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
