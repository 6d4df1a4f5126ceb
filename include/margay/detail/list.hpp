// An intrusive doubly linked list. A node that is destroyed or inserted into another list removes itself from its list,
// so the owner of a node can destroy it at any time.
#pragma once

namespace margay {

// A node whose owner calls unlink() before it destroys the node.
class ListLink {
  public:
    ListLink() = default;
    ListLink(const ListLink&) = delete;
    ListLink& operator=(const ListLink&) = delete;

    [[nodiscard]] bool linked() const { return next_ != this; }
    void unlink() {
        previous_->next_ = next_;
        next_->previous_ = previous_;  // NOLINT(clang-analyzer-core.NullDereference): a node is in a ring, always
        previous_ = next_ = this;
    }

  private:
    template <class T>
    friend class List;
    ListLink* previous_ = this;
    ListLink* next_ = this;
};

class ListNode : public ListLink {
  public:
    ListNode() = default;
    ~ListNode() { unlink(); }
};

// T derives from ListLink. The list owns nothing.
template <class T>
class List {
  public:
    [[nodiscard]] bool empty() const { return !head_.linked(); }
    [[nodiscard]] T* front() { return empty() ? nullptr : static_cast<T*>(head_.next_); }
    [[nodiscard]] T* back() { return empty() ? nullptr : static_cast<T*>(head_.previous_); }
    // The neighbours of `node`; nullptr at the ends of the list.
    [[nodiscard]] T* after(T& node) {
        ListLink* next = static_cast<ListLink&>(node).next_;
        return next == &head_ ? nullptr : static_cast<T*>(next);
    }
    [[nodiscard]] T* before(T& node) {
        ListLink* previous = static_cast<ListLink&>(node).previous_;
        return previous == &head_ ? nullptr : static_cast<T*>(previous);
    }
    void push_back(T& node) { insert(head_, node); }
    void push_front(T& node) { insert(*head_.next_, node); }
    void insert_before(T& place, T& node) { insert(place, node); }
    T* pop_front() {
        T* node = front();
        if (node != nullptr) node->unlink();
        return node;
    }
    // Moves all nodes of `other` to the end of this list, in the same order.
    void take_back(List& other) {
        while (T* node = other.pop_front()) push_back(*node);
    }

  private:
    static void insert(ListLink& before, ListLink& node) {
        node.unlink();
        node.previous_ = before.previous_;
        node.next_ = &before;
        before.previous_->next_ = &node;  // NOLINT(clang-analyzer-core.NullDereference): as above
        before.previous_ = &node;
    }
    ListNode head_;
};

}  // namespace margay
