// The page of `rtradar view`: the linked views and nothing else.

unpackPlotly().then(drawLinked).then(() => { document.documentElement.dataset.ready = "true"; });
