// The page of `rtradar view`: the linked views and nothing else.

drawLinked().then(() => { document.documentElement.dataset.ready = "true"; });
