"""Files on disk: blobs, scratch folders, the cache of decoded clouds."""
