"""The store of blobs that the settings name."""

from __future__ import annotations

from service.settings import Settings
from service.storage.blobs import BlobStore


def open_blobs(settings: Settings) -> BlobStore:
    """Open the data directory's own blobs, or those of the bucket of MPE_BLOB_URL."""
    if settings.blob.url is None:
        return BlobStore(settings.data_dir)
    from service.storage.bucket import Bucket
    from service.storage.s3_blobs import S3BlobStore

    return S3BlobStore(
        settings.data_dir,
        Bucket(settings.blob),
        cache_bytes=settings.blob.cache_bytes,
        grace_s=settings.blob.grace_s,
    )
